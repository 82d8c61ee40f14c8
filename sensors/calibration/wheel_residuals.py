"""Roll of the wheels over each segment, its standard deviations, and the paper's straight line through the lengths."""

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


class MeasuredSegment(NamedTuple):
    """Roll of both sides over one segment, step by step (n,) [m], and the standard deviations of its residuals."""

    segment: Segment
    left: Floats
    right: Floats
    distance_std_m: float
    turn_std_rad: float


class LinearFit(NamedTuple):
    """The paper's straight line, actual = scale * measured + offset, over whole straight moves (section II-B)."""

    line: LinearDistance
    scale: Interval
    offset_m: Interval
    measured_m: Floats
    true_m: Floats


def measured_segments(segments: Sequence[Segment], runs: Sequence[Wheels], robot: Robot) -> list[MeasuredSegment]:
    """The wheels' side of every segment that they cover."""
    measured = []
    for segment in segments:
        wheels = runs[segment.run]
        if wheels.covers(segment.from_ns, segment.until_ns):
            left, right = wheels.between(segment.from_ns, segment.until_ns)
            measured.append(MeasuredSegment(segment, left, right, *_stds(robot, wheels.resolution_m, left, right)))
    return measured


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


def linear_trend(pieces: Sequence[MeasuredSegment]) -> LinearFit | None:
    """The first step: least squares over the straight moves, None of fewer than three lengths."""
    from scipy.stats import linregress

    straight = [each for each in pieces if each.segment.kind == STRAIGHT and each.segment.distance_m > 0.0]
    measured = np.array([abs(0.5 * float(each.left.sum() + each.right.sum())) for each in straight])
    true = np.array([each.segment.distance_m for each in straight])
    if len(straight) < 3 or np.ptp(measured) < 1e-9:
        return None
    line, freedom = linregress(measured, true), len(straight) - 2
    return LinearFit(
        LinearDistance.fit(measured.tolist(), true.tolist()),
        Interval.of(float(line.slope), float(line.stderr), freedom),
        Interval.of(float(line.intercept), float(line.intercept_stderr), freedom),
        measured,
        true,
    )
