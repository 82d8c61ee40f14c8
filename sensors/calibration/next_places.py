"""The next places to measure: distances at which one more reading lowers the uncertainty most.

Design of experiment (Fedorov 1972, chapter 3): of all distances the floor has, the one that lowers the variance of the
prediction most, averaged over the distances that readings were taken at (the V criterion). A far place determines the
slope, a near one the level; the need for either depends on the readings there are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fusion import World
from fusion.arrays import Floats
from fusion.radio import RadioKind
from sensors.calibration.line import Line
from sensors.calibration.readings_by_place import Readings

CANDIDATES = 60


class Advice(NamedTuple):
    """One more place at ``distance_m`` from an anchor: standard deviation of the gain with it and all advice before."""

    distance_m: float
    gain_std: float


def pooled_covariance(line: Line) -> Floats:
    """Of (mean level, gain), (2, 2)."""
    anchors = len(line.covariance) - 1
    pick = np.zeros((2, anchors + 1))
    pick[0, 1:], pick[1, 0] = 1.0 / anchors, 1.0
    return np.asarray(pick @ line.covariance @ pick.T)


def next_places(world: World, kind: RadioKind, readings: Readings, line: Line, count: int = 3) -> list[Advice]:
    """The best ``count`` places to add, one after another, each a place of its own."""
    candidates = _reachable(world)
    gain_at: Callable[[Floats], Floats] = world.anchors[0].model(kind).by_gain
    rows = np.column_stack([np.ones(CANDIDATES), gain_at(candidates)])
    measured = np.column_stack([np.ones(len(readings.gain)), readings.gain])
    weight, covariance, places = measured.T @ measured / len(measured), pooled_covariance(line), list[Advice]()
    for _ in range(count):
        moved = rows @ covariance
        novelty = line.place_std**2 + np.einsum("ij,ij->i", moved, rows)
        best = int(np.argmax(np.einsum("ij,jk,ik->i", moved, weight, moved) / novelty))
        covariance = covariance - np.outer(moved[best], moved[best]) / novelty[best]
        places.append(Advice(float(candidates[best]), math.sqrt(float(covariance[1, 1]))))
    return places


def _reachable(world: World) -> Floats:
    """Distances [m] that the floor has to any anchor, evenly in logarithm."""
    bounds, up = world.bounds, world.robot.antenna_m[2]
    near, far = math.inf, 0.0
    for anchor in world.anchors:
        across = max(bounds.x_min - anchor.x, anchor.x - bounds.x_max, 0.0)
        along = max(bounds.y_min - anchor.y, anchor.y - bounds.y_max, 0.0)
        near = min(near, math.hypot(across, along, up - anchor.z))
        wide = max(abs(bounds.x_min - anchor.x), abs(bounds.x_max - anchor.x))
        deep = max(abs(bounds.y_min - anchor.y), abs(bounds.y_max - anchor.y))
        far = max(far, math.hypot(wide, deep, up - anchor.z))
    return np.geomspace(max(near, 0.5), max(far, 1.0), CANDIDATES)
