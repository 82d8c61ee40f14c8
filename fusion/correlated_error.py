"""Errors that neighbouring readings share: a filter that takes each as new is surer than it may be.

Shadowing belongs to the place (Gudmundson 1991), an offset to the radio. Where such an error is no state of a filter,
its variance counts as many times as readings repeat it.
"""

from __future__ import annotations

import math

from fusion.errors import ParameterError
from fusion.radio import DistanceModel, PathLoss
from fusion.radio_reading import RadioReading

SHADOWING_LENGTH_M = 2.0
"""Path over which an anchor's shadowing stays correlated [m], where the world does not state it."""
MAX_CORRELATED = 3.0
"""Largest number of neighbouring readings that are taken to share one error, where the path over which they do is a
guess; a parameter of the filter may state another.
"""
MAX_CORRELATED_KNOWN = 20.0
"""The same where the world states that path."""


def total_variance(reading: RadioReading) -> float:
    """Variance of a reading about its expectation [the reading's unit squared]: its own noise, and the errors it shares
    with other readings of its anchor, or of its kind; that of the kind grows with distance, which is taken from the
    reading itself.
    """
    model = reading.model
    by_gain = float(model.by_gain(model.distance(reading.value)))
    return float(reading.variance + model.bias_std**2 + (by_gain * model.gain_std) ** 2)


def correlated_count(path_m: float, length_m: float, max_correlated: float) -> float:
    """Number of readings of one anchor, ``path_m`` apart, that share an error which lasts for ``length_m``: each then
    counts for as much less. ``max_correlated`` bounds it, for a robot at rest would learn nothing more.

    >>> [correlated_count(path_m, length_m=2.0, max_correlated=3.0) for path_m in (0.0, 1.0, 5.0)]
    [3.0, 2.0, 1.0]
    """
    return min(max(length_m / max(path_m, 1e-9), 1.0), max_correlated)


def correlated_count_of(model: DistanceModel, path_m: float, max_correlated: float | None, length_m: float) -> float:
    """`correlated_count` for the common error of an anchor's ``model``; ``length_m`` holds where the world states none,
    ``max_correlated`` None stands for `MAX_CORRELATED` or `MAX_CORRELATED_KNOWN`.
    """
    known_m = model.bias_length_m
    bound = max_correlated or (MAX_CORRELATED if known_m is None else MAX_CORRELATED_KNOWN)
    return correlated_count(path_m, known_m or length_m, bound)


def repeated_variance(reading: RadioReading, path_m: float, max_correlated: float | None) -> float:
    """`total_variance` for an update by one of many readings, ``path_m`` after the one before. Shadowing belongs to the
    place (Gudmundson 1991), so the common variance of signal strengths counts `correlated_count` times.
    """
    model, count = reading.model, 1.0
    if isinstance(model, PathLoss):
        count = correlated_count_of(model, path_m, max_correlated, SHADOWING_LENGTH_M)
    return total_variance(reading) + (count - 1.0) * model.bias_std**2


def require_max_correlated(name: str, max_correlated: float | None) -> float | None:
    """``max_correlated``; raises `ParameterError` where it is neither None nor a finite number of at least one."""
    if max_correlated is not None and not 1.0 <= max_correlated < math.inf:
        raise ParameterError(
            f"{name}: max_correlated is {max_correlated}; give a number from 1, which takes all as independent"
        )
    return max_correlated
