"""``fusion calibrate gyro``: bias, drift, scale and noise of a gyro."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from fusion.output.tables import Table
from fusion.robot import Robot
from logs.run import Run
from sensors.calibration.gyro import GyroCalibration, calibrate_gyro
from sensors.calibration.gyro_picture import draw
from sensors.calibration.held_out import Interval, table
from sensors.cli.calibration import Findings, calibrate, configure_common

METHOD = (
    "mean of standstills shown by the wheels, scale by least squares through the origin, overlapping Allan deviation"
)
DEGREES = math.degrees(1.0)


def findings(runs: Sequence[Run], turns: float | None = None) -> Findings:
    """The calibration as tables, sentences and changes of a world."""
    calibration = calibrate_gyro(runs, turns)
    robot = runs[0].world.robot
    tables = [_table(calibration, robot)]
    if calibration.scores:
        tables.append(table("Gyro where it was not calibrated", calibration.scores))
    return Findings(
        name="gyro",
        method=METHOD,
        samples=len(calibration.standstills),
        residual_std=float(np.std([stop.bias for stop in calibration.standstills])),
        tables=tables,
        remarks=_remarks(calibration, robot),
        result=calibration._asdict(),
        draw=partial(draw, calibration),
        changes={"robot": _changes(calibration, robot)},
        anchors={},
    )


def _changes(calibration: GyroCalibration, robot: Robot) -> dict[str, object]:
    """The noise too, but only where the gyro gives the turn: else these keys speak of the wheels."""
    changes: dict[str, object] = {"gyro_bias_rad_s": calibration.bias.value}
    if calibration.scale is not None:
        changes["gyro_scale"] = calibration.scale.value
    noise = {}
    if calibration.allan is not None:
        noise["turn_std_per_sqrt_s"] = calibration.allan.noise.value
    if calibration.drift_rad_s is not None:
        noise["turn_bias_std_rad_s"] = math.hypot(calibration.drift_rad_s, calibration.bias.std)
    return changes | ({"noise": noise} if robot.turn_source == "gyro" and noise else {})


def _table(calibration: GyroCalibration, robot: Robot) -> Table:
    rows = [("bias, °/s", f"{DEGREES * robot.gyro_bias_rad_s:.4f}", _degrees(calibration.bias).text(4))]
    if calibration.drift_rad_s is not None:
        rows.append(("its drift between standstills, °/s", "", f"{DEGREES * calibration.drift_rad_s:.4f}"))
    if calibration.trend is not None:
        rows.append(("its change, °/s an hour", "", _degrees(calibration.trend).text(2)))
    if calibration.scale is not None:
        rows.append(("scale, true over measured", f"{robot.gyro_scale:.4f}", calibration.scale.text(4)))
    if calibration.allan is not None:
        noise, lowest = _degrees(calibration.allan.noise), DEGREES * calibration.allan.bias_instability
        rows.append(("noise density, °/√s", f"{DEGREES * robot.noise.turn_std_per_sqrt_s:.4f}", noise.text(4)))
        rows.append(("bias instability, °/s", "", f"{'' if calibration.allan.is_lowest else 'below '}{lowest:.4f}"))
    title = f"Gyro, from {len(calibration.standstills)} standstills and {len(calibration.turns)} turns"
    return Table(title, ("", "world", "fit, 95 %"), tuple(rows))


def _degrees(interval: Interval) -> Interval:
    return Interval(*(DEGREES * each for each in interval))


def _remarks(calibration: GyroCalibration, robot: Robot) -> list[str]:
    remarks = ["the log has no temperature: the bias holds for the warmth of this run"]
    if len(calibration.standstills) == 1:
        remarks.append("a single standstill: no measure of how the bias drifts; stop again, and at the end")
    if calibration.scale is None:
        remarks.append(
            "fewer than three turns with a true heading: no scale; turn ten times by a mark and give --turns 10"
        )
    if calibration.allan is None or not calibration.allan.is_lowest:
        remarks.append("the longest standstill is too short to see the bias wander; for its instability stand an hour")
    if robot.turn_source != "gyro":
        remarks.append(
            f"the world takes the turn from its {robot.turn_source}: these numbers wait until turn_source = gyro"
        )
    return remarks


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion calibrate gyro``."""
    configure_common(parser)
    parser.add_argument(
        "--turns", type=float, metavar="N", help="whole turns from the first standstill to the last, left positive"
    )


def run(arguments: argparse.Namespace) -> int:
    """Calibrate and report."""
    return calibrate(arguments, partial(findings, turns=arguments.turns))
