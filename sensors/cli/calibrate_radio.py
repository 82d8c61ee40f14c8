"""``fusion calibrate radio``: path loss and shadowing of signal strengths, scale and offset of ranges."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from fusion import ParameterError, World
from fusion.output.tables import Table
from fusion.radio import RadioKind
from logs.run import Run
from sensors.calibration.held_out import Interval, table
from sensors.calibration.radio import RadioCalibration, calibrate_radio, changes, kinds_in
from sensors.calibration.radio_picture import draw
from sensors.calibration.readings_by_place import UNITS
from sensors.cli.calibration import Findings, calibrate, configure_common

METHOD = "Huber's M-estimator over places, covariance by correlation over the floor (Gudmundson 1991, REML)"
GAINS: dict[RadioKind, str] = {"rssi": "path-loss exponent n", "range": "scale"}
LEVELS: dict[RadioKind, str] = {"rssi": "RSSI at the reference distance, dBm", "range": "offset, m"}
WIDE: dict[RadioKind, float] = {"rssi": 1.0, "range": 0.2}
"""An interval of the gain that reaches further is of no use."""
SELDOM = 0.95
"""Received in a smaller share of the scans, the weak readings that are missing bend the line."""


def findings(runs: Sequence[Run], points: Path | None = None, place_m: float | None = None) -> Findings:
    """The calibration of every kind of readings in the runs, as tables, sentences and changes of a world."""
    if place_m is not None and not (math.isfinite(place_m) and place_m > 0.0):
        raise ParameterError(f"--place {place_m}: must be a radius in metres greater than zero")
    world = runs[0].world
    calibrations = [calibrate_radio(runs, kind, points, place_m) for kind in kinds_in(runs)]
    pooled: dict[str, object] = {}
    single: dict[str, dict[str, object]] = {}
    for each in calibrations:
        common, own = changes(world, each)
        pooled |= common
        for anchor, change in own.items():
            single[anchor] = single.get(anchor, {}) | change
    return Findings(
        name="radio",
        method=METHOD,
        samples=sum(len(each.readings.value) for each in calibrations),
        residual_std=calibrations[0].std,
        tables=[table for each in calibrations for table in _tables(world, each)],
        remarks=[remark for each in calibrations for remark in _remarks(each)],
        result={each.kind: _result(each) for each in calibrations},
        draw=partial(draw, world, calibrations),
        changes=pooled,
        anchors=dict(single),
    )


def _result(calibration: RadioCalibration) -> dict[str, object]:
    line = calibration.line
    return {
        "gain": line.gain_interval(),
        "level": line.level_interval(),
        "level_std_between_anchors": line.level_std_between,
        "std": calibration.std,
        "std_in_place": calibration.medians.scatter,
        "std_between_places": line.place_std,
        "correlation_length_m": line.length_m,
        "uncorrelated_share": line.share,
        "readings": len(calibration.readings.value),
        "places": int(calibration.readings.place.max()) + 1,
        "place_m": calibration.readings.place_m,
        "medians": line.medians,
        "effective_medians": line.effective,
        "anchors": calibration.anchors,
        "held_out": calibration.scores,
        "next_places": calibration.advice,
    }


def _tables(world: World, calibration: RadioCalibration) -> list[Table]:
    readings, line, unit = calibration.readings, calibration.line, UNITS[calibration.kind]
    count = int(readings.place.max()) + 1
    title = f"{calibration.kind}: {len(readings.value)} readings at {count} places of {readings.place_m:.2g} m"
    rows = [
        (GAINS[calibration.kind], line.gain_interval().text(3)),
        (f"{LEVELS[calibration.kind]}, mean of the anchors", line.level_interval().text(3)),
        (f"anchors' levels apart, {unit}", f"{line.level_std_between:.2f}"),
        (f"σ of one reading, {unit}", f"{calibration.std:.2f}"),
        (f"  of it within a place, {unit}", f"{calibration.medians.scatter:.2f}"),
        (f"  of it between places, {unit}", f"{line.place_std:.2f}"),
        ("  which stays alike over, m", f"{line.length_m:.2f}"),
        (f"medians of one anchor and place: {line.medians}, worth", f"{line.effective:.0f}"),
    ]
    head = "anchor", "places", GAINS[calibration.kind], LEVELS[calibration.kind], f"σ places, {unit}", "received %"
    tables = [
        Table(title, ("", "fit, 95 %"), tuple(rows)),
        Table("Each anchor by itself", head, tuple(_anchor_rows(world, calibration))),
    ]
    if calibration.scores:
        tables.append(table(f"{calibration.kind} at places that were not fitted", calibration.scores))
    return tables


def _anchor_rows(world: World, calibration: RadioCalibration) -> Iterator[tuple[str, ...]]:
    for anchor in world.anchors:
        fit = calibration.anchors[anchor.id]
        std = "–" if math.isnan(fit.place_std) else f"{fit.place_std:.2f}"
        received = f"{100.0 * fit.received:.0f}" if calibration.kind == "rssi" else "–"
        yield anchor.id, str(fit.places), _text(fit.gain), _text(fit.level), std, received


def _text(interval: Interval | None) -> str:
    return "–" if interval is None else interval.text(2)


def _remarks(calibration: RadioCalibration) -> Iterator[str]:
    gain = calibration.line.gain_interval()
    if gain.reach > WIDE[calibration.kind]:
        yield (
            f"{calibration.kind}: {GAINS[calibration.kind]} and level can hardly be separated, {gain.text(2)}: "
            "the readings are too few, or at too equal distances"
        )
    if calibration.kind == "rssi":
        for name, share in calibration.readings.received.items():
            if share < SELDOM:
                yield (
                    f"rssi: {name} was received in {100.0 * share:.0f} % of the scans; where only its strong readings "
                    "are received, n comes out too low"
                )
    near = ", ".join(f"{each.distance_m:.1f} m" for each in calibration.advice)
    yield (
        f"{calibration.kind}: you need more places near d = {near}: they would bring the standard deviation of the "
        f"{GAINS[calibration.kind]} from {gain.std:.2g} to {calibration.advice[-1].gain_std:.2g}"
    )
    if not calibration.scores:
        yield f"{calibration.kind}: too few places to leave some out: no measure of how good this is"


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion calibrate radio``."""
    configure_common(parser)
    parser.add_argument(
        "--points",
        type=Path,
        metavar="FILE",
        help="surveyed places in place of the truth: CSV of from_s, until_s, x_m, y_m",
    )
    parser.add_argument(
        "--place", type=float, metavar="M", help="radius of a place; by default 1 m, or so that there are 200"
    )


def run(arguments: argparse.Namespace) -> int:
    """Calibrate and report."""
    return calibrate(arguments, partial(findings, points=arguments.points, place_m=arguments.place))
