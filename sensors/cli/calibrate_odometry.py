"""``fusion calibrate odometry``: the wheels' scales and the effective track, from straight lines and turns."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from fusion.output.tables import Table
from logs.run import Run
from sensors.calibration.arcs import WheelScales
from sensors.calibration.held_out import BeforeAfter, table
from sensors.calibration.odometry import (
    OdometryCalibration,
    calibrate_odometry,
    residuals,
)
from sensors.calibration.odometry_picture import draw
from sensors.cli.calibration import Findings, calibrate, configure_common

METHOD = "regularised least squares over exact arcs (Gauss-Newton), variance components after Helmert"


def findings(runs: Sequence[Run], segments: Path | None = None) -> Findings:
    """The calibration as tables, sentences and changes of a world."""
    calibration = calibrate_odometry(runs, segments)
    robot = calibration.fit.scales.applied_to(calibration.robot)
    changes = {
        "distance_scale": robot.distance_scale,
        "distance_offset_m": robot.distance_offset_m,
        "diameter_ratio": robot.diameter_ratio,
        "track_width_m": robot.track_width_m,
    }
    pieces, scales, trend = calibration.pieces, calibration.fit.scales, calibration.trend
    return Findings(
        name="odometry",
        method=METHOD,
        samples=len(pieces),
        residual_std=float(np.nanstd(residuals(scales, pieces)[0])),
        tables=_tables(calibration),
        remarks=_remarks(calibration),
        result={
            "numbers": calibration.numbers,
            "trend": None if trend is None else {"scale": trend.scale, "offset_m": trend.offset_m},
            "held_out": calibration.scores,
            "umbmark": calibration.umbmark,
            "segments": [each.segment for each in pieces],
        },
        draw=partial(draw, trend, pieces, WheelScales.of(calibration.robot), scales),
        changes=None if calibration.ready_made else {"robot": changes},
        anchors={},
    )


def _tables(calibration: OdometryCalibration) -> list[Table]:
    was = WheelScales.of(calibration.robot)
    before = (was.left, was.right, 0.5 * (was.left + was.right), was.right / was.left, was.track_m)
    numbers = zip(calibration.numbers.items(), before, strict=True)
    rows = [(name, f"{old:.4f}", number.text(4)) for (name, number), old in numbers]
    if calibration.trend is not None:
        rows += [
            ("the paper's line: scale", "", calibration.trend.scale.text(4)),
            ("the paper's line: offset, m", "", calibration.trend.offset_m.text(4)),
        ]
    kinds = [each.segment.kind for each in calibration.pieces]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    tables = [Table(f"Wheels, from {counts}", ("true over measured", "world", "fit, 95 %"), tuple(rows))]
    if calibration.scores:
        tables.append(table("Odometry on the half that was not fitted", calibration.scores))
    if calibration.umbmark is not None:
        was_m, now_m = (each.e_max_m for each in calibration.umbmark)
        score = BeforeAfter("UMBmark E_max,syst", "m", calibration.squares, was_m, now_m)
        tables.append(table("Squares, fitted without them", [score]))
    return tables


def _remarks(calibration: OdometryCalibration) -> list[str]:
    remarks = []
    if not calibration.scores:
        remarks.append("too few pieces to hold half of them out: no measure of how good this is; record a longer run")
    if calibration.trend is not None and not calibration.trend.offset_m.holds(0.0):
        remarks.append(
            f"the paper's line does not pass through zero, its offset is {calibration.trend.offset_m.text(3)} m: "
            "wheels that slip at each start, or a truth that lags behind; the fit and the world have no such offset"
        )
    turns = [each.segment.turn_rad for each in calibration.pieces if abs(each.segment.turn_rad) > 0.5]
    if turns and (min(turns) > 0.0 or max(turns) < 0.0):
        remarks.append("all turns go one way: unequal wheels and a wrong track look alike; turn the other way as often")
    if calibration.ready_made:
        remarks.append(
            "the log holds ready-made increments and no ticks, which a world's wheels do not touch: correct the driver "
            "by these numbers"
        )
    if calibration.squares and calibration.umbmark is None:
        remarks.append("UMBmark needs squares in both senses, and lines and turns outside of them")
    return remarks


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion calibrate odometry``."""
    configure_common(parser)
    parser.add_argument(
        "--segments", type=Path, metavar="FILE", help="measured by hand: CSV of from_s, until_s, distance_m, turn_rad"
    )


def run(arguments: argparse.Namespace) -> int:
    """Calibrate and report."""
    return calibrate(arguments, partial(findings, segments=arguments.segments))
