"""Calibration of odometry: a scale for each side and the effective track, from pieces of known length or turn.

Regularised least squares by Gauss and Newton, over the exact arcs of `arcs`. The residuals, measured minus modelled
lengths and turns, stand over their standard deviations: the truth's, the noise of the world's odometry, and the
encoders' resolution; three more hold both scales near one and the track near the nominal. The variances of lengths, of
turns and of the drift of straight lines are estimated beside (variance components after Helmert; Koch 1999, section
3.6), since they depend on the floor. The covariance is (Jᵀ J)⁻¹ of the result.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusion import LogError, ParameterError
from fusion.arrays import Flags, Floats, Whole
from fusion.robot import Robot
from logs.run import Run
from sensors.calibration.arcs import WheelScales, arc_end, turn_rad
from sensors.calibration.held_out import BeforeAfter, Interval, root_mean_square
from sensors.calibration.segments import STRAIGHT, Segment, find_segments, read_segments
from sensors.calibration.umbmark import Square, Umbmark, find_squares, judge
from sensors.calibration.wheel_residuals import LinearFit, MeasuredSegment, linear_trend, measured_segments
from sensors.calibration.wheels import Wheels, nominal, wheels

SCALE_STD, TRACK_STD = 0.1, 0.3
"""Standard deviations of a scale from one, and of a track from the nominal, as a share of it: the priors."""
ROUNDS = 5
LEAST_SEGMENTS = 4
GROUPS = ("lengths", "turns of straight pieces", "turns of all others")
"""Residuals that scatter alike; each has a variance of its own."""
LEAST_FREEDOM = 2.0
"""With fewer degrees a group's variance is taken as assumed."""


class ScalesFit(NamedTuple):
    """The estimate, the covariance of (left, right, track_m), degrees of freedom, and the scatter of each of `GROUPS`
    about it, over the assumed one.
    """

    scales: WheelScales
    covariance: Floats
    freedom: float
    factors: tuple[float, ...]

    def interval(self, derivative: Sequence[float], value: float) -> Interval:
        """Of a function of the three, by its derivatives."""
        gradient = np.asarray(derivative)
        return Interval.of(value, math.sqrt(float(gradient @ self.covariance @ gradient)), self.freedom)


def residuals(scales: WheelScales, pieces: Sequence[MeasuredSegment]) -> Floats:
    """True minus modelled length [m] and turn [rad] of every segment, (2, n), NaN where not known."""
    errors = np.full((2, len(pieces)), np.nan)
    for i, each in enumerate(pieces):
        if math.isfinite(each.segment.distance_m):
            errors[0, i] = each.segment.distance_m - _length_m(scales, each)
        if math.isfinite(each.segment.turn_rad):
            errors[1, i] = each.segment.turn_rad - float(turn_rad(scales, each.left, each.right).sum())
    return errors


def _length_m(scales: WheelScales, piece: MeasuredSegment) -> float:
    """From a segment's beginning to its end. A straight one is a single arc: step by step, the wobble of whole ticks
    would shorten it.
    """
    steps = (piece.left, piece.right)
    left, right = [[side.sum()] for side in steps] if piece.segment.kind == STRAIGHT else steps
    end = arc_end(scales, np.asarray(left), np.asarray(right))
    return math.hypot(end.x, end.y)


def fit_scales(pieces: Sequence[MeasuredSegment], track_m: float, trend: LinearFit | None = None) -> ScalesFit:
    """The scales that explain ``pieces`` best, starting at the paper's line; raises `LogError` for too few pieces."""
    check(pieces)
    scale = trend.line.scale if trend is not None and trend.line.scale > 0.0 else 1.0
    scales, factors, group = WheelScales(scale, scale, scale * track_m), np.ones(len(GROUPS)), _groups(pieces)
    for _ in range(ROUNDS):
        scales, jacobian = _gauss_newton(scales, pieces, track_m, factors[group])
        factors = _factors(scales, pieces, jacobian, group)
    scales, jacobian = _gauss_newton(scales, pieces, track_m, factors[group])
    covariance: Floats = np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)
    return ScalesFit(scales, covariance, max(len(jacobian) - 6.0, 1.0), tuple(map(float, factors)))


def _groups(pieces: Sequence[MeasuredSegment]) -> Whole:
    """Indices into `GROUPS` of the lengths and the turns, (2, n)."""
    straight = np.array([each.segment.kind == STRAIGHT for each in pieces])
    return np.stack([np.zeros(len(pieces), dtype=np.int64), np.where(straight, 1, 2)])


def check(pieces: Sequence[MeasuredSegment]) -> None:
    """Refuse pieces that do not determine all three numbers; raises `LogError`."""
    lengths = sum(math.isfinite(each.segment.distance_m) for each in pieces)
    turns = [each.segment.turn_rad for each in pieces if abs(each.segment.turn_rad) > 0.5]
    if len(pieces) < LEAST_SEGMENTS or not lengths or not turns:
        raise LogError(
            f"{lengths} pieces of known length and {len(turns)} turns are too few to calibrate the wheels; drive at "
            "least three straight lines and four spins, alternately left and right, or give them with --segments FILE"
        )


def _gauss_newton(
    start: WheelScales, pieces: Sequence[MeasuredSegment], track_m: float, factors: Floats
) -> tuple[WheelScales, Floats]:
    """The minimum and its Jacobian (m + 3, 3): a row for every known length, then turn, and three for the priors."""
    from scipy.optimize import least_squares

    stds, known = _assumed(pieces) * factors, _known(pieces)

    def rows(numbers: Floats) -> Floats:
        scales = WheelScales(*numbers)
        whole = (residuals(scales, pieces) / stds)[known]
        priors = (
            (1.0 - scales.left) / SCALE_STD,
            (1.0 - scales.right) / SCALE_STD,
            (1.0 - scales.track_m / track_m) / TRACK_STD,
        )
        return np.concatenate([whole, priors])

    fit = least_squares(rows, np.array(start), jac="3-point", method="lm", x_scale=np.array(start))
    return WheelScales(*map(float, fit.x)), np.asarray(fit.jac)


def _factors(scales: WheelScales, pieces: Sequence[MeasuredSegment], jacobian: Floats, group: Whole) -> Floats:
    """Scatter of each group over the assumed one, by its own degrees of freedom: rows without leverage."""
    leverage = np.einsum("ij,jk,ik->i", jacobian, np.linalg.inv(jacobian.T @ jacobian), jacobian)[:-3]
    known = _known(pieces)
    squares, group = np.square(residuals(scales, pieces) / _assumed(pieces))[known], group[known]
    freedom = np.bincount(group, 1.0 - leverage, minlength=len(GROUPS))
    total = np.bincount(group, squares, minlength=len(GROUPS))
    is_enough = freedom >= LEAST_FREEDOM
    return np.where(is_enough, np.sqrt(np.maximum(total / np.where(is_enough, freedom, 1.0), 1e-12)), 1.0)


def _assumed(pieces: Sequence[MeasuredSegment]) -> Floats:
    """Standard deviations of lengths [m] and turns [rad], (2, n)."""
    return np.array([(each.distance_std_m, each.turn_std_rad) for each in pieces]).T


def _known(pieces: Sequence[MeasuredSegment]) -> Flags:
    """True for the lengths and turns that are known, (2, n)."""
    return np.asarray(np.isfinite([(each.segment.distance_m, each.segment.turn_rad) for each in pieces])).T


def halves(pieces: Sequence[MeasuredSegment]) -> tuple[list[MeasuredSegment], list[MeasuredSegment]]:
    """Two by two of each kind in turn, so that both halves hold straight lines, and turns in both senses."""
    seen, parts = Counter[str](), (list[MeasuredSegment](), list[MeasuredSegment]())
    for each in pieces:
        parts[seen[each.segment.kind] // 2 % 2].append(each)
        seen[each.segment.kind] += 1
    return parts


def score_held_out(pieces: Sequence[MeasuredSegment], before: WheelScales, track_m: float) -> list[BeforeAfter]:
    """Fitted on either half, judged on the other, both together. Empty where a half is too poor to be fitted."""
    parts = halves(pieces)
    try:
        fits = [fit_scales(part, track_m, linear_trend(part)).scales for part in parts]
    except LogError:
        return []
    was = np.concatenate([residuals(before, part) for part in parts], axis=1)
    now = np.concatenate([residuals(*pair) for pair in zip(fits[::-1], parts, strict=True)], axis=1)
    names = ("length of a piece", "m", 1.0), ("turn of a piece", "°", math.degrees(1.0))
    return [
        BeforeAfter(what, unit, len(w), each * root_mean_square(w), each * root_mean_square(n))
        for (what, unit, each), w, n in zip(names, map(_finite, was), map(_finite, now), strict=True)
        if len(w)
    ]


def _finite(errors: Floats) -> Floats:
    return errors[np.isfinite(errors)]


class OdometryCalibration(NamedTuple):
    """Result of a calibration. ``umbmark``: before and after, the latter fitted without the squares it judges."""

    robot: Robot
    fit: ScalesFit
    trend: LinearFit | None
    pieces: Sequence[MeasuredSegment]
    scores: Sequence[BeforeAfter]
    umbmark: tuple[Umbmark, Umbmark] | None
    squares: int
    ready_made: bool

    @property
    def numbers(self) -> dict[str, Interval]:
        """The numbers of interest, each with its interval."""
        scales, interval = self.fit.scales, self.fit.interval
        ratio = scales.right / scales.left
        return {
            "left scale": interval((1.0, 0.0, 0.0), scales.left),
            "right scale": interval((0.0, 1.0, 0.0), scales.right),
            "mean scale": interval((0.5, 0.5, 0.0), 0.5 * (scales.left + scales.right)),
            "right over left, E_d": interval((-ratio / scales.left, 1.0 / scales.left, 0.0), ratio),
            "effective track, m": interval((0.0, 0.0, 1.0), scales.track_m),
        }


def calibrate_odometry(runs: Sequence[Run], segments: Path | None = None) -> OdometryCalibration:
    """From the segments that the truth of the ``runs`` shows, or those of a file, for a single run.

    Raises `LogError` where there is no truth, there are no wheels, or too few segments.
    """
    if segments is not None and len(runs) != 1:
        raise ParameterError(f"--segments {segments} measures one run, got {len(runs)}; calibrate that one alone")
    robot, sides = nominal(runs[0].world.robot), [wheels(run) for run in runs]
    before = WheelScales.of(runs[0].world.robot)
    segments_of = [
        find_segments(run, i, own) if segments is None else read_segments(segments, run, i)
        for i, (run, own) in enumerate(zip(runs, sides, strict=True))
    ]
    pieces = measured_segments([segment for own in segments_of for segment in own], sides, robot)
    squares = [square for run, own in zip(runs, segments_of, strict=True) for square in find_squares(run, own)]
    trend = linear_trend(pieces)
    return OdometryCalibration(
        runs[0].world.robot,
        fit_scales(pieces, robot.track_width_m, trend),
        trend,
        pieces,
        score_held_out(pieces, before, robot.track_width_m),
        _umbmark(pieces, squares, sides, before, robot.track_width_m),
        len(squares),
        any(each.ready_made for each in sides),
    )


def _umbmark(
    pieces: Sequence[MeasuredSegment],
    squares: Sequence[Square],
    runs: Sequence[Wheels],
    before: WheelScales,
    track_m: float,
) -> tuple[Umbmark, Umbmark] | None:
    """Squares are judged by a fit to what lies outside them; None without squares in both senses, or the rest."""
    outside = [each for each in pieces if not any(_overlap(square, each.segment) for square in squares)]
    was = judge(before, squares, runs, track_m)
    try:
        now = judge(fit_scales(outside, track_m, linear_trend(outside)).scales, squares, runs, track_m)
    except LogError:
        return None
    return None if was is None or now is None else (was, now)


def _overlap(square: Square, segment: Segment) -> bool:
    return square.run == segment.run and square.from_ns < segment.until_ns and segment.from_ns < square.until_ns
