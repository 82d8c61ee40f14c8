"""``fusion calibrate odometry``: the wheels' scales and the effective track, from straight lines and turns."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from fusion.output.tables import Sheet
from logs.run import Run
from sensors.calibration.arcs import Roll
from sensors.calibration.held_out import BeforeAfter, sheet
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
