"""UMBmark: squares driven in both senses, and the distance from the end of odometry to that of the robot.

The benchmark of Borenstein & Feng (1996, "Measurement and Correction of Systematic Odometry Errors in Mobile Robots"):
the centres of gravity of the end offsets of either sense lie apart, since a wrong track and unequal wheels add up in
one sense and cancel in the other. The farther of the two is E_max,syst. Their closed form for both errors follows from
small angles: with wheels that differ by a percent and sides of metres it no longer holds, and the fit of `odometry` is
the method; the number is what before and after are compared by.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusion import Pose, wrap_angle
from fusion.arrays import Floats
from logs.run import Run
from logs.truth import Instants, interpolate_truth, known_truth
from sensors.calibration.arcs import WheelScales, arc_end
from sensors.calibration.segments import GAP_S, STRAIGHT, Segment
from sensors.calibration.wheels import Wheels

SIDE_TOLERANCE = 0.15
"""Sides may differ by, and the square may stay open by, this share of a side."""
TURN_TOLERANCE_RAD = math.radians(20.0)


class Square(NamedTuple):
    """Four sides of a run, without the last turn. ``sense``: 1 counter-clockwise, -1 clockwise. ``end``: where the
    robot ended, in the frame that begins where it began, with the first side for x axis; ``heading``: its own.
    """

    run: int
    from_ns: int
    until_ns: int
    sense: int
    side_m: float
    end: tuple[float, float]
    heading: float


class Umbmark(NamedTuple):
    """E_max,syst [m], and by the closed form: track error E_b (actual over nominal) and diameter ratio E_d (right over
    left), from the centres of gravity of the end offsets, true minus calculated [m].
    """

    clockwise_m: tuple[float, float]
    counter_clockwise_m: tuple[float, float]
    e_max_m: float
    track_ratio: float
    diameter_ratio: float


def umbmark(clockwise_m: Floats, counter_clockwise_m: Floats, side_m: float, track_m: float) -> Umbmark:
    """From end offsets (n, 2) of either sense, true minus calculated, first side along x."""
    cw, ccw = clockwise_m.mean(axis=0), counter_clockwise_m.mean(axis=0)
    alpha = float(cw[0] + ccw[0]) / (-4.0 * side_m)
    beta = float(cw[0] - ccw[0]) / (-4.0 * side_m)
    half = math.sin(0.5 * beta)
    diameters = 1.0 if half == 0.0 else _ratio(0.5 * side_m / half, track_m)
    return Umbmark(
        (float(cw[0]), float(cw[1])),
        (float(ccw[0]), float(ccw[1])),
        float(max(np.hypot(*cw), np.hypot(*ccw))),
        0.5 * math.pi / (0.5 * math.pi - alpha),
        diameters,
    )


def _ratio(radius_m: float, track_m: float) -> float:
    """Diameters of the wheels of a robot that drives a circle where it means to go straight."""
    return (radius_m + 0.5 * track_m) / (radius_m - 0.5 * track_m)


def find_squares(run: Run, segments: Sequence[Segment]) -> list[Square]:
    """Squares among the straight pieces of one run, none overlapping another; none without truth all the way."""
    truth = None if run.truth is None else known_truth(run.truth)
    if truth is None or len(truth.time_ns) < 2:
        return []
    first_ns, last_ns = truth.time_ns[[0, -1]]
    sides = [
        each for each in segments if each.kind == STRAIGHT and each.from_ns >= first_ns and each.until_ns <= last_ns
    ]
    squares: list[Square] = []
    i = 0
    while i + 4 <= len(sides):
        square = _square(truth, sides[i : i + 4])
        if square is not None:
            squares.append(square)
        i += 4 if square is not None else 1
    return squares


def _square(truth: Instants, sides: Sequence[Segment]) -> Square | None:
    times = np.array([time for side in sides for time in (side.from_ns, side.until_ns)], dtype=np.int64)
    poses, kept = interpolate_truth(truth, times, gap_s=GAP_S)
    x, y = poses.x.reshape(4, 2), poses.y.reshape(4, 2)
    course = np.arctan2(y[:, 1] - y[:, 0], x[:, 1] - x[:, 0])
    turns = np.array([wrap_angle(float(turn)) for turn in np.diff(course)])
    lengths = np.hypot(x[:, 1] - x[:, 0], y[:, 1] - y[:, 0])
    side = float(lengths.mean())
    sense = 1 if turns[0] > 0.0 else -1
    open_m = math.hypot(x[3, 1] - x[0, 0], y[3, 1] - y[0, 0])
    is_square = np.abs(turns - sense * 0.5 * math.pi).max() < TURN_TOLERANCE_RAD
    if not kept.all() or not is_square or max(float(np.abs(lengths - side).max()), open_m) > SIDE_TOLERANCE * side:
        return None
    frame = Pose(float(x[0, 0]), float(y[0, 0]), float(course[0]))
    end = frame.inverse().transform(float(x[3, 1]), float(y[3, 1]))
    heading = float(poses.heading[0]) - frame.heading
    return Square(
        sides[0].run, int(times[0]), int(times[-1]), sense, side, end, 0.0 if math.isnan(heading) else heading
    )


def offsets(scales: WheelScales, squares: Sequence[Square], runs: Sequence[Wheels]) -> Floats:
    """True minus calculated end of every square (n, 2) [m]."""
    misses = []
    for square in squares:
        moved = arc_end(scales, *runs[square.run].between(square.from_ns, square.until_ns))
        x, y = Pose(0.0, 0.0, square.heading).transform(moved.x, moved.y)
        misses.append((square.end[0] - x, square.end[1] - y))
    return np.array(misses, dtype=np.float64).reshape(-1, 2)


def judge(scales: WheelScales, squares: Sequence[Square], runs: Sequence[Wheels], track_m: float) -> Umbmark | None:
    """The benchmark of one calibration; None unless there are squares in both senses."""
    senses = np.array([square.sense for square in squares])
    if not ((senses > 0).any() and (senses < 0).any()):
        return None
    ends, side = offsets(scales, squares, runs), float(np.mean([square.side_m for square in squares]))
    return umbmark(ends[senses < 0], ends[senses > 0], side, track_m)
