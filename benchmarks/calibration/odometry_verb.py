"""``fusion calibrate odometry``: the wheels' scales and the effective track, from straight lines and turns."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.calibration.arcs import Roll
from benchmarks.calibration.arguments import Findings, calibrate, configure_common
from benchmarks.calibration.held_out import BeforeAfter, Interval, sheet
from benchmarks.calibration.odometry import (
    RollFit,
    fit_roll,
    residuals,
    score_held_out,
)
from benchmarks.calibration.odometry_picture import draw
from benchmarks.calibration.rolled import Rolled, Trend, linear_trend, rolled
from benchmarks.calibration.segments import find_segments, read_segments
from benchmarks.calibration.umbmark import Square, Umbmark, find_squares, judge
from benchmarks.calibration.wheels import Wheels, nominal, wheels
from benchmarks.sheet import Sheet
from fusion import LogError, ParameterError
from fusion.world import Robot
from logs.run import Run

METHOD = "regularised least squares over exact arcs (Gauss-Newton), variance components after Helmert"


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


def findings(runs: Sequence[Run], segments: Path | None = None) -> Findings:
    """The calibration as tables, sentences and changes of a world."""
    found = calibrate_odometry(runs, segments)
    robot = found.fit.roll.told(found.robot)
    changes = {
        "distance_scale": robot.distance_scale,
        "distance_offset_m": robot.distance_offset_m,
        "diameter_ratio": robot.diameter_ratio,
        "track_width_m": robot.track_width_m,
    }
    errors = residuals(found.fit.roll, found.told)[0]
    return Findings(
        name="odometry",
        method=METHOD,
        samples=len(found.told),
        residual_std=float(np.nanstd(errors)),
        sheets=_sheets(found),
        remarks=_remarks(found),
        result={
            "numbers": found.numbers,
            "trend": None if found.trend is None else {"scale": found.trend.scale, "offset_m": found.trend.offset_m},
            "held_out": found.scores,
            "umbmark": found.umbmark,
            "segments": [each.segment for each in found.told],
        },
        draw=partial(draw, found.trend, found.told, Roll.of(found.robot), found.fit.roll),
        changes=None if found.ready_made else {"robot": changes},
        anchors={},
    )


def _sheets(found: OdometryCalibration) -> list[Sheet]:
    was = Roll.of(found.robot)
    before = (was.left, was.right, 0.5 * (was.left + was.right), was.right / was.left, was.track_m)
    rows = [
        (name, f"{old:.4f}", number.text(4)) for (name, number), old in zip(found.numbers.items(), before, strict=True)
    ]
    if found.trend is not None:
        rows += [
            ("the paper's line: scale", "", found.trend.scale.text(4)),
            ("the paper's line: offset, m", "", found.trend.offset_m.text(4)),
        ]
    kinds = [each.segment.kind for each in found.told]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    sheets = [Sheet(f"Wheels, from {counts}", ("true over measured", "world", "fit, 95 %"), tuple(rows))]
    if found.scores:
        sheets.append(sheet("Odometry on the half that was not fitted", found.scores))
    if found.umbmark is not None:
        was_m, now_m = (each.e_max_m for each in found.umbmark)
        score = BeforeAfter("UMBmark E_max,syst", "m", found.squares, was_m, now_m)
        sheets.append(sheet("Squares, fitted without them", [score]))
    return sheets


def _remarks(found: OdometryCalibration) -> list[str]:
    told = []
    if not found.scores:
        told.append("too few pieces to hold half of them out: nothing says how good this is; record a longer run")
    if found.trend is not None and not found.trend.offset_m.holds(0.0):
        told.append(
            f"the paper's line does not pass through zero, its offset is {found.trend.offset_m.text(3)} m: wheels that "
            "slip at each start, or a truth that lags behind; the fit and the world have no such offset"
        )
    senses = {math.copysign(1.0, each.segment.turn_rad) for each in found.told if abs(each.segment.turn_rad) > 0.5}
    if len(senses) == 1:
        told.append("all turns go one way: unequal wheels and a wrong track look alike; turn the other way as often")
    if found.ready_made:
        told.append(
            "the log holds ready-made increments and no ticks, which a world's wheels do not touch: correct the driver "
            "by these numbers"
        )
    if found.squares and found.umbmark is None:
        told.append("UMBmark needs squares in both senses, and lines and turns outside of them")
    return told


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion calibrate odometry``."""
    configure_common(parser)
    parser.add_argument(
        "--segments", type=Path, metavar="FILE", help="measured by hand: CSV of from_s, until_s, distance_m, turn_rad"
    )


def run(arguments: argparse.Namespace) -> int:
    """Calibrate and tell."""
    return calibrate(arguments, partial(findings, segments=arguments.segments))
