"""Errors that neighbouring readings share: a filter that takes each as new is surer than it may be.

Shadowing belongs to the place (Gudmundson 1991), an offset to the radio. Where such an error is no state of a filter,
its variance counts as many times as readings repeat it.
"""

from __future__ import annotations

import math

from fusion.errors import ParameterError
from fusion.radio import DistanceModel, PathLoss
from fusion.radio_reading import Sighting

SHADOWING_LENGTH_M = 2.0
"""Path over which an anchor's shadowing stays alike [m], where the world does not tell."""


MOST_ALIKE, MOST_ALIKE_TOLD = 3.0, 20.0
"""How many neighbouring readings at most are taken to share one error, unless a parameter says otherwise: where the
path over which they do is a guess, and where the world tells it.
"""


def total_variance(sighting: Sighting) -> float:
    """Variance of a reading about its expectation: its own noise, and the errors it shares with other readings of its
    anchor, or of its kind; that of the kind grows with distance, which is taken from the reading itself.
    """
    model = sighting.model
    by_gain = float(model.by_gain(model.distance(sighting.value)))
    return float(sighting.variance + model.bias_std**2 + (by_gain * model.gain_std) ** 2)


def alike(path_m: float, length_m: float, most_alike: float) -> float:
    """How many readings of one anchor, ``path_m`` apart, share an error that lasts for ``length_m``: each then counts
    for as much less. ``most_alike`` bounds it, for a robot at rest would learn nothing more.

    >>> [alike(path_m, length_m=2.0, most_alike=3.0) for path_m in (0.0, 1.0, 5.0)]
    [3.0, 2.0, 1.0]
    """
    return min(max(length_m / max(path_m, 1e-9), 1.0), most_alike)


def sharing(model: DistanceModel, path_m: float, most_alike: float | None, length_m: float) -> float:
    """`alike` for the common error of an anchor's ``model``; ``length_m`` where the world does not tell its own,
    ``most_alike`` None: as much as is known of it.
    """
    told = model.bias_length_m
    bound = most_alike or (MOST_ALIKE if told is None else MOST_ALIKE_TOLD)
    return alike(path_m, told or length_m, bound)


def repeated_variance(sighting: Sighting, path_m: float, most_alike: float | None) -> float:
    """`total_variance` for an update by one of many readings, ``path_m`` after the one before. Shadowing belongs to the
    place (Gudmundson 1991), so what neighbouring signal strengths share is taken as many times as they are `alike`.
    """
    model = sighting.model
    times = sharing(model, path_m, most_alike, SHADOWING_LENGTH_M) if isinstance(model, PathLoss) else 1.0
    return total_variance(sighting) + (times - 1.0) * model.bias_std**2


def require_most_alike(name: str, most_alike: float | None) -> float | None:
    """``most_alike``; raises `ParameterError` where it is neither None nor a finite number of at least one."""
    if most_alike is not None and not 1.0 <= most_alike < math.inf:
        raise ParameterError(
            f"{name}: most_alike is {most_alike}; give a number from 1, which takes all as independent"
        )
    return most_alike
