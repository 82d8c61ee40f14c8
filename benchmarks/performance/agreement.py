"""The answers of two implementations on one drive: a speed for another answer does not count."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.performance.drive import Drive
from benchmarks.performance.implementation import Belief, Implementation
from fusion import FusionError, wrap_angle

TOLERANCE = 1e-9
"""Largest difference of pose [m, rad] and covariance [m^2, m rad, rad^2] between answers that count as the same."""


class Answer(NamedTuple):
    """An implementation's answers on a drive: root mean square error of the position [m], and ``apart``, the largest
    difference to those of the reference, None where the same answer is not possible: another model or another method.
    """

    name: str
    rmse_m: float
    apart: float | None = None


def beliefs(implementation: Implementation, driven: Drive) -> list[Belief]:
    """The belief after every scan."""
    made, found = implementation.start(driven), []
    for steps, scan in implementation.blocks(driven):
        made.move(steps)
        made.update(scan)
        found.append(made.belief())
    return found


def rmse_m(found: list[Belief], driven: Drive) -> float:
    """Root mean square error of the position [m]."""
    places = np.array([belief.pose[:2] for belief in found])
    return math.sqrt(float(np.square(places - driven.poses[:, :2]).sum(axis=1).mean()))


def apart(ours: list[Belief], theirs: list[Belief]) -> float:
    """The largest difference of any number of pose and covariance; infinite where only one side claims a covariance."""
    return max(_apart(own, other) for own, other in zip(ours, theirs, strict=True))


def _apart(own: Belief, other: Belief) -> float:
    if own.covariance is None or other.covariance is None:
        return math.inf
    turn = wrap_angle(own.pose.heading - other.pose.heading)
    pairs = zip((*own.pose[:2], *own.covariance), (*other.pose[:2], *other.covariance), strict=True)
    differences = [abs(turn), *(abs(a - b) for a, b in pairs)]
    return max(differences) if all(map(math.isfinite, differences)) else math.inf


def require_agreement(ours: Implementation, reference: Implementation, driven: Drive) -> Answer:
    """The answers of ``ours``; raises `FusionError` where they are not those of ``reference``."""
    own = beliefs(ours, driven)
    difference = apart(own, beliefs(reference, driven))
    if not difference <= TOLERANCE:
        raise FusionError(
            f"{ours.name} and {reference.name} answer differently on the same drive, by up to {difference:.2g} where "
            f"{TOLERANCE:.0e} is allowed: their speeds cannot be compared; find out which of them is wrong"
        )
    return Answer(ours.name, rmse_m(own, driven), difference)
