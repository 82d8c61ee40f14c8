"""What the wheels told of each segment, how far that may scatter, and the paper's straight line through it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusion.arrays import Floats
from fusion.odometry import LinearDistance
from fusion.robot import OdometryNoise, Robot
from sensors.calibration.held_out import Interval
from sensors.calibration.segments import STRAIGHT, Segment
from sensors.calibration.wheels import Wheels

TRUTH_STD_M = 0.01
TRUTH_STD_RAD = 0.02
"""Of the truth at either end of a piece, before its scatter is known."""


class Rolled(NamedTuple):
    """What the wheels told of one segment: steps of either side (n,) [m], and what its residuals should scatter by."""

    segment: Segment
    left: Floats
    right: Floats
    distance_std_m: float
    turn_std_rad: float


class Trend(NamedTuple):
    """The paper's straight line, actual = scale * measured + offset, over whole straight moves (section II-B)."""

    line: LinearDistance
    scale: Interval
    offset_m: Interval
    measured_m: Floats
    true_m: Floats


def rolled(segments: Sequence[Segment], runs: Sequence[Wheels], robot: Robot) -> list[Rolled]:
    """The wheels' side of every segment that they cover."""
    found = []
    for segment in segments:
        told = runs[segment.run]
        if told.covers(segment.from_ns, segment.until_ns):
            left, right = told.between(segment.from_ns, segment.until_ns)
            found.append(Rolled(segment, left, right, *_stds(robot, told.resolution_m, left, right)))
    return found


def _stds(robot: Robot, resolution_m: float, left: Floats, right: Floats) -> tuple[float, float]:
    """Of the length [m] and the turn [rad]: a side read at both ends in whole ticks is off by tick / sqrt(6)."""
    noise, track_m = robot.noise, robot.track_width_m
    path_m = 0.5 * float(np.abs(left + right).sum())
    turned = float(np.abs(right - left).sum()) / track_m
    side = resolution_m**2 / 6.0
    distance = 2.0 * TRUTH_STD_M**2 + noise.distance_std_per_sqrt_m**2 * path_m + 0.5 * side
    turn = 2.0 * TRUTH_STD_RAD**2 + _turn_variance(noise, path_m, turned) + 2.0 * side / track_m**2
    return math.sqrt(distance), math.sqrt(turn)


def _turn_variance(noise: OdometryNoise, path_m: float, turned_rad: float) -> float:
    return noise.turn_std_per_sqrt_m**2 * path_m + noise.turn_std_per_sqrt_rad**2 * turned_rad


def linear_trend(told: Sequence[Rolled]) -> Trend | None:
    """The first step: least squares over the straight moves, None of fewer than three lengths."""
    from scipy.stats import linregress

    straight = [each for each in told if each.segment.kind == STRAIGHT and each.segment.distance_m > 0.0]
    measured = np.array([abs(0.5 * float(each.left.sum() + each.right.sum())) for each in straight])
    true = np.array([each.segment.distance_m for each in straight])
    if len(straight) < 3 or np.ptp(measured) < 1e-9:
        return None
    found, freedom = linregress(measured, true), len(straight) - 2
    return Trend(
        LinearDistance.fit(measured.tolist(), true.tolist()),
        Interval.of(float(found.slope), float(found.stderr), freedom),
        Interval.of(float(found.intercept), float(found.intercept_stderr), freedom),
        measured,
        true,
    )
