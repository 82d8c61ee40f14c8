"""Parameters of an estimator as words of a command line."""

from __future__ import annotations

import json
from collections.abc import Sequence

from fusion.errors import ParameterError


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
