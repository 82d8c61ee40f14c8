"""Parameters of an estimator as words of a command line."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import fusion
from fusion.errors import ParameterError, did_you_mean
from fusion.world import World


def parse_value(text: str) -> object:
    """A JSON value, or the text itself where it is none."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def parse_options(words: Sequence[str]) -> dict[str, object]:
    """``parameter=value`` words as the parameters of one estimator; raises `ParameterError` for other words.

    >>> parse_options(["gate_probability=0.99", "mode=fast"])
    {'gate_probability': 0.99, 'mode': 'fast'}
    """
    options: dict[str, object] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise ParameterError(f"--set {word}: expected PARAMETER=VALUE, as in gate_probability=0.99")
        options[key] = parse_value(value)
    return options


Settings = Mapping[str, Mapping[str, object]]
"""Parameters by estimator."""


def require_estimators(estimators: Sequence[str]) -> None:
    """Raises `PluginError` for one that cannot be brought in, `NotInstalledError` where its package is missing."""
    for name in estimators:
        fusion.load(name)


def require_settings(settings: Settings, estimators: Sequence[str], world: World) -> None:
    """Raises `ParameterError` for parameters that an estimator refuses, or of one that is not chosen."""
    for name, options in settings.items():
        if name not in estimators:
            raise ParameterError(
                f"--set {name}: this estimator is not among the chosen ones; {did_you_mean(name, estimators)}"
            )
        fusion.build(name, world, options)


def parse_settings(words: Sequence[str]) -> dict[str, dict[str, object]]:
    """``estimator.parameter=value`` words as parameters by estimator; a value is a JSON value, or else text.

    >>> parse_settings(["ekf.gate_probability=0.99", "ekf.mode=fast"])
    {'ekf': {'gate_probability': 0.99, 'mode': 'fast'}}
    """
    settings: dict[str, dict[str, object]] = {}
    for word in words:
        target, equals, value = word.partition("=")
        estimator, dot, parameter = target.partition(".")
        if not (equals and dot and estimator and parameter):
            raise ParameterError(f"--set {word}: expected ESTIMATOR.PARAMETER=VALUE, as in ekf.gate_probability=0.99")
        settings.setdefault(estimator, {})[parameter] = parse_value(value)
    return settings
