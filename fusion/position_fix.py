"""Memoryless position fixes from radio readings that lie close together in time, and their innovation against odometry.

A Wi-Fi scan receives all anchors at once; ranging radios measure one at a time. `Recent` keeps the last reading of each
anchor for a short window, so both give fixes by the same code.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusion.arrays import Floats
from fusion.geometry import Pose
from fusion.radio_reading import RadioReading
from fusion.robot import Robot
from fusion.trilateration import Fix, are_collinear, trilaterate
from fusion.values import Reason

MINIMUM_ANCHORS = 3


class TimedReading(NamedTuple):
    """A reading and the time of its scan [ns]."""

    time_ns: int
    reading: RadioReading


Recent = tuple[TimedReading, ...]


def remember(recent: Recent, time_ns: int, new: tuple[RadioReading, ...], window_ns: int) -> Recent:
    """``recent`` with the ``new`` readings in place of older ones of the same anchor, none older than the window."""
    by_anchor = {old.reading.anchor.id: old for old in recent if time_ns - old.time_ns <= window_ns}
    by_anchor.update({reading.anchor.id: TimedReading(time_ns, reading) for reading in new})
    return tuple(by_anchor[anchor_id] for anchor_id in sorted(by_anchor))


def fix_from(recent: Recent, robot: Robot) -> Fix | Reason:
    """The antenna's position from the remembered readings, or the reason there is none.

    Slant distances are brought to the floor with the anchors' heights; a distance's standard deviation is that of
    the reading, its anchor's common error included, over the model's slope there.
    """
    if len(recent) < MINIMUM_ANCHORS:
        return Reason.TOO_FEW_ANCHORS
    readings = [timed.reading for timed in recent]
    anchors = np.array([[item.anchor.x, item.anchor.y] for item in readings])
    if are_collinear(anchors):
        return Reason.COLLINEAR_ANCHORS
    slant = np.array([float(item.model.distance(item.value)) for item in readings])
    rise = np.array([item.anchor.z - robot.antenna_m[2] for item in readings])
    flat = np.sqrt(np.maximum(slant**2 - rise**2, 1e-6))
    slopes = np.array([abs(float(item.model.slope(d))) for item, d in zip(readings, slant, strict=True)])
    variances = [item.variance + item.model.bias_std**2 for item in readings]
    stds = np.sqrt(variances) / np.maximum(slopes, 1e-3)
    return trilaterate(anchors, flat, np.maximum(stds, 1e-3))


def fix_innovation(pose: Pose, fix: Fix, robot: Robot) -> tuple[Floats, Floats]:
    """Fix minus the antenna's predicted position, (2,) [m], and that position's Jacobian by the pose, (2, 3)."""
    forward, left, _ = robot.antenna_m
    x, y = pose.transform(forward, left)
    jacobian = np.array([[1.0, 0.0, -(y - pose.y)], [0.0, 1.0, x - pose.x]])
    return np.array([fix.x - x, fix.y - y]), jacobian
