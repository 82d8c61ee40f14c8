"""What the wheels really roll: a scale for each side and the effective track, from pieces of known length or turn.

Regularised least squares by Gauss and Newton, over the exact arcs of `arcs`. The residuals, measured minus modelled
lengths and turns, stand over their standard deviations: the truth's, the noise of the world's odometry, and the
encoders' resolution; three more hold both scales near one and the track near the nominal. How far lengths, turns and
the drift of straight lines really scatter is estimated beside (variance components after Helmert; Koch 1999, section
3.6), since nobody knows the floor beforehand. The covariance is (Jᵀ J)⁻¹ of the result.
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
from sensors.calibration.arcs import Roll, arc_end, turn_rad
from sensors.calibration.held_out import BeforeAfter, Interval, root_mean_square
from sensors.calibration.segments import STRAIGHT, find_segments, read_segments
from sensors.calibration.umbmark import Square, Umbmark, find_squares, judge
from sensors.calibration.wheel_residuals import Rolled, Trend, linear_trend, rolled
from sensors.calibration.wheels import Wheels, nominal, wheels

SCALE_STD, TRACK_STD = 0.1, 0.3
"""How far a scale may be from one, and a track from the nominal, as a share of it: the priors."""
ROUNDS = 5
LEAST_SEGMENTS = 4
GROUPS = ("lengths", "turns of straight pieces", "turns of all others")
"""Residuals that scatter alike; each has a variance of its own."""
LEAST_FREEDOM = 2.0
"""With fewer degrees a group's variance is taken as assumed."""


class RollFit(NamedTuple):
    """The estimate, the covariance of (left, right, track_m), degrees of freedom, and how far the rows of each of
    `GROUPS` scatter about it, over what was assumed.
    """

    roll: Roll
    covariance: Floats
    freedom: float
    factors: tuple[float, ...]

    def interval(self, derivative: Sequence[float], value: float) -> Interval:
        """Of a function of the three, by its derivatives."""
        gradient = np.asarray(derivative)
        return Interval.of(value, math.sqrt(float(gradient @ self.covariance @ gradient)), self.freedom)


def residuals(roll: Roll, told: Sequence[Rolled]) -> Floats:
    """True minus modelled length [m] and turn [rad] of every segment, (2, n), NaN where not known."""
    found = np.full((2, len(told)), np.nan)
    for i, each in enumerate(told):
        if math.isfinite(each.segment.distance_m):
            found[0, i] = each.segment.distance_m - _length_m(roll, each)
        if math.isfinite(each.segment.turn_rad):
            found[1, i] = each.segment.turn_rad - float(turn_rad(roll, each.left, each.right).sum())
    return found


def _length_m(roll: Roll, told: Rolled) -> float:
    """From a segment's beginning to its end. A straight one is a single arc: step by step, the wobble of whole ticks
    would shorten it.
    """
    steps = (told.left, told.right)
    left, right = [[side.sum()] for side in steps] if told.segment.kind == STRAIGHT else steps
    end = arc_end(roll, np.asarray(left), np.asarray(right))
    return math.hypot(end.x, end.y)


def fit_roll(told: Sequence[Rolled], track_m: float, trend: Trend | None = None) -> RollFit:
    """The roll that explains ``told`` best, from the paper's trend on; raises `LogError` where they are too few."""
    check(told)
    scale = trend.line.scale if trend is not None and trend.line.scale > 0.0 else 1.0
    roll, factors, group = Roll(scale, scale, scale * track_m), np.ones(len(GROUPS)), _groups(told)
    for _ in range(ROUNDS):
        roll, jacobian = _gauss_newton(roll, told, track_m, factors[group])
        factors = _factors(roll, told, jacobian, group)
    roll, jacobian = _gauss_newton(roll, told, track_m, factors[group])
    covariance: Floats = np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)
    return RollFit(roll, covariance, max(len(jacobian) - 6.0, 1.0), tuple(map(float, factors)))


def _groups(told: Sequence[Rolled]) -> Whole:
    """Which of `GROUPS` the lengths and the turns belong to, (2, n)."""
    straight = np.array([each.segment.kind == STRAIGHT for each in told])
    return np.stack([np.zeros(len(told), dtype=np.int64), np.where(straight, 1, 2)])


def check(told: Sequence[Rolled]) -> None:
    """Refuse what cannot tell all three numbers."""
    lengths = sum(math.isfinite(each.segment.distance_m) for each in told)
    turns = [each.segment.turn_rad for each in told if abs(each.segment.turn_rad) > 0.5]
    if len(told) < LEAST_SEGMENTS or not lengths or not turns:
        raise LogError(
            f"{lengths} pieces of known length and {len(turns)} turns are too few to calibrate the wheels; drive at "
            "least three straight lines and four spins, alternately left and right, or give them with --segments FILE"
        )


def _gauss_newton(start: Roll, told: Sequence[Rolled], track_m: float, factors: Floats) -> tuple[Roll, Floats]:
    """The minimum and its Jacobian (m + 3, 3): a row for every known length, then turn, and three for the priors."""
    from scipy.optimize import least_squares

    stds, known = _assumed(told) * factors, _known(told)

    def rows(numbers: Floats) -> Floats:
        roll = Roll(*numbers)
        whole = (residuals(roll, told) / stds)[known]
        priors = (
            (1.0 - roll.left) / SCALE_STD,
            (1.0 - roll.right) / SCALE_STD,
            (1.0 - roll.track_m / track_m) / TRACK_STD,
        )
        return np.concatenate([whole, priors])

    found = least_squares(rows, np.array(start), jac="3-point", method="lm", x_scale=np.array(start))
    return Roll(*map(float, found.x)), np.asarray(found.jac)


def _factors(roll: Roll, told: Sequence[Rolled], jacobian: Floats, group: Whole) -> Floats:
    """How much more each group scatters than assumed, by its own degrees of freedom: rows without leverage."""
    leverage = np.einsum("ij,jk,ik->i", jacobian, np.linalg.inv(jacobian.T @ jacobian), jacobian)[:-3]
    known = _known(told)
    squares, group = np.square(residuals(roll, told) / _assumed(told))[known], group[known]
    freedom = np.bincount(group, 1.0 - leverage, minlength=len(GROUPS))
    total = np.bincount(group, squares, minlength=len(GROUPS))
    told_enough = freedom >= LEAST_FREEDOM
    return np.where(told_enough, np.sqrt(np.maximum(total / np.where(told_enough, freedom, 1.0), 1e-12)), 1.0)


def _assumed(told: Sequence[Rolled]) -> Floats:
    """Standard deviations of lengths [m] and turns [rad], (2, n)."""
    return np.array([(each.distance_std_m, each.turn_std_rad) for each in told]).T


def _known(told: Sequence[Rolled]) -> Flags:
    """Which lengths and turns are known, (2, n)."""
    return np.asarray(np.isfinite([(each.segment.distance_m, each.segment.turn_rad) for each in told])).T


def halves(told: Sequence[Rolled]) -> tuple[list[Rolled], list[Rolled]]:
    """Two by two of each kind in turn, so that both halves hold straight lines, and turns in both senses."""
    seen, found = Counter[str](), (list[Rolled](), list[Rolled]())
    for each in told:
        found[seen[each.segment.kind] // 2 % 2].append(each)
        seen[each.segment.kind] += 1
    return found


def score_held_out(told: Sequence[Rolled], before: Roll, track_m: float) -> list[BeforeAfter]:
    """Fitted on either half, judged on the other, both together. Empty where a half is too poor to be fitted."""
    parts = halves(told)
    try:
        fits = [fit_roll(part, track_m, linear_trend(part)).roll for part in parts]
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
    """Everything that was found. ``umbmark``: before and after, the latter fitted without the squares it judges."""

    robot: Robot
    fit: RollFit
    trend: Trend | None
    told: Sequence[Rolled]
    scores: Sequence[BeforeAfter]
    umbmark: tuple[Umbmark, Umbmark] | None
    squares: int
    ready_made: bool

    @property
    def numbers(self) -> dict[str, Interval]:
        """What people ask for, each with its interval."""
        roll, interval = self.fit.roll, self.fit.interval
        ratio = roll.right / roll.left
        return {
            "left scale": interval((1.0, 0.0, 0.0), roll.left),
            "right scale": interval((0.0, 1.0, 0.0), roll.right),
            "mean scale": interval((0.5, 0.5, 0.0), 0.5 * (roll.left + roll.right)),
            "right over left, E_d": interval((-ratio / roll.left, 1.0 / roll.left, 0.0), ratio),
            "effective track, m": interval((0.0, 0.0, 1.0), roll.track_m),
        }


def calibrate_odometry(runs: Sequence[Run], segments: Path | None = None) -> OdometryCalibration:
    """From the segments that the truth of the ``runs`` shows, or those of a file, for a single run.

    Raises `LogError` where there is no truth, there are no wheels, or too few segments.
    """
    if segments is not None and len(runs) != 1:
        raise ParameterError(f"--segments {segments} measures one run, got {len(runs)}; calibrate that one alone")
    robot, told_by = nominal(runs[0].world.robot), [wheels(run) for run in runs]
    before = Roll.of(runs[0].world.robot)
    found = [
        find_segments(run, i, told) if segments is None else read_segments(segments, run, i)
        for i, (run, told) in enumerate(zip(runs, told_by, strict=True))
    ]
    told = rolled([segment for own in found for segment in own], told_by, robot)
    squares = [square for run, own in zip(runs, found, strict=True) for square in find_squares(run, own)]
    trend = linear_trend(told)
    return OdometryCalibration(
        runs[0].world.robot,
        fit_roll(told, robot.track_width_m, trend),
        trend,
        told,
        score_held_out(told, before, robot.track_width_m),
        _umbmark(told, squares, told_by, before, robot.track_width_m),
        len(squares),
        any(each.ready_made for each in told_by),
    )


def _umbmark(
    told: Sequence[Rolled], squares: Sequence[Square], runs: Sequence[Wheels], before: Roll, track_m: float
) -> tuple[Umbmark, Umbmark] | None:
    """Squares are judged by a fit to what lies outside them; None without squares in both senses, or the rest."""
    outside = [
        each
        for each in told
        if not any(
            square.run == each.segment.run
            and square.from_ns < each.segment.until_ns
            and each.segment.from_ns < square.until_ns
            for square in squares
        )
    ]
    was = judge(before, squares, runs, track_m)
    try:
        now = judge(fit_roll(outside, track_m, linear_trend(outside)).roll, squares, runs, track_m)
    except LogError:
        return None
    return None if was is None or now is None else (was, now)
