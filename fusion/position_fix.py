"""Memoryless position fixes from whatever radio readings lie close together in time, and what methods need that weigh
such fixes against odometry.

A Wi-Fi scan hears all anchors at once; ranging radios hear one at a time. `Recent` keeps the last reading of each
anchor for a short window, so both give fixes by the same code.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion.geometry import Pose
from fusion.radio_reading import Sighting
from fusion.trilateration import Fix, are_collinear, trilaterate
from fusion.values import Reason
from fusion.world import Robot

MINIMUM_ANCHORS = 3

Array = NDArray[np.float64]


class Heard(NamedTuple):
    """A sighting and when it was made."""

    time_ns: int
    sighting: Sighting


Recent = tuple[Heard, ...]


def remember(recent: Recent, time_ns: int, new: tuple[Sighting, ...], window_ns: int) -> Recent:
    """``recent`` with the ``new`` sightings in place of older ones of the same anchor, none older than the window."""
    by_anchor = {heard.sighting.anchor.id: heard for heard in recent if time_ns - heard.time_ns <= window_ns}
    by_anchor.update({sighting.anchor.id: Heard(time_ns, sighting) for sighting in new})
    return tuple(by_anchor[anchor_id] for anchor_id in sorted(by_anchor))


def fix_from(recent: Recent, robot: Robot) -> Fix | Reason:
    """The antenna's position from the remembered sightings, or the reason there is none.

    Slant distances are brought to the floor with the anchors' heights; a distance's standard deviation is that of
    the reading, its anchor's common error included, over the model's slope there.
    """
    if len(recent) < MINIMUM_ANCHORS:
        return Reason.TOO_FEW_ANCHORS
    seen = [heard.sighting for heard in recent]
    anchors = np.array([[item.anchor.x, item.anchor.y] for item in seen])
    if are_collinear(anchors):
        return Reason.COLLINEAR_ANCHORS
    slant = np.array([float(item.model.distance(item.value)) for item in seen])
    rise = np.array([item.anchor.z - robot.antenna_m[2] for item in seen])
    flat = np.sqrt(np.maximum(slant**2 - rise**2, 1e-6))
    slopes = np.array([abs(float(item.model.slope(d))) for item, d in zip(seen, slant, strict=True)])
    variances = [item.variance + item.model.bias_std**2 for item in seen]
    stds = np.sqrt(variances) / np.maximum(slopes, 1e-3)
    return trilaterate(anchors, flat, np.maximum(stds, 1e-3))


def fix_innovation(pose: Pose, fix: Fix, robot: Robot) -> tuple[Array, Array]:
    """Fix minus the antenna's predicted position, (2,) [m], and that position's Jacobian by the pose, (2, 3)."""
    forward, left, _ = robot.antenna_m
    x, y = pose.transform(forward, left)
    jacobian = np.array([[1.0, 0.0, -(y - pose.y)], [0.0, 1.0, x - pose.x]])
    return np.array([fix.x - x, fix.y - y]), jacobian
