"""``fusion calibrate radio``: path loss and shadowing of signal strengths, scale and offset of ranges."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from fusion import ParameterError, World
from fusion.output.tables import Sheet
from fusion.radio import RadioKind
from logs.run import Run
from sensors.calibration.held_out import Interval, sheet
from sensors.calibration.radio import RadioCalibration, calibrate_radio, changes, kinds_in
from sensors.calibration.radio_picture import draw
from sensors.calibration.readings_by_place import UNITS
from sensors.cli.calibration import Findings, calibrate, configure_common

METHOD = "Huber's M-estimator over places, covariance by correlation over the floor (Gudmundson 1991, REML)"
GAINS: dict[RadioKind, str] = {"rssi": "path-loss exponent n", "range": "scale"}
LEVELS: dict[RadioKind, str] = {"rssi": "RSSI at the reference distance, dBm", "range": "offset, m"}
WIDE: dict[RadioKind, float] = {"rssi": 1.0, "range": 0.2}
"""An interval of the gain that reaches further says nothing of use."""
SELDOM = 0.95
"""Heard in a smaller share of the scans, the weak readings that are missing bend the line."""


def findings(runs: Sequence[Run], points: Path | None = None, place_m: float | None = None) -> Findings:
    """The calibration of every kind of readings in the runs, as tables, sentences and changes of a world."""
    if place_m is not None and not (math.isfinite(place_m) and place_m > 0.0):
        raise ParameterError(f"--place {place_m}: must be a radius in metres greater than zero")
    world = runs[0].world
    found = [calibrate_radio(runs, kind, points, place_m) for kind in kinds_in(runs)]
    pooled: dict[str, object] = {}
    single: dict[str, dict[str, object]] = {}
    for each in found:
        common, own = changes(world, each)
        pooled |= common
        for anchor, change in own.items():
            single[anchor] = single.get(anchor, {}) | change
    return Findings(
        name="radio",
        method=METHOD,
        samples=sum(len(each.readings.value) for each in found),
        residual_std=found[0].std,
        sheets=[table for each in found for table in _sheets(world, each)],
        remarks=[remark for each in found for remark in _remarks(each)],
        result={each.kind: _result(each) for each in found},
        draw=partial(draw, world, found),
        changes=pooled,
        anchors=dict(single),
    )


def _result(found: RadioCalibration) -> dict[str, object]:
    line = found.line
    return {
        "gain": line.gain_interval(),
        "level": line.level_interval(),
        "level_std_between_anchors": line.level_std_between,
        "std": found.std,
        "std_in_place": found.spots.scatter,
        "std_between_places": line.place_std,
        "correlation_length_m": line.length_m,
        "uncorrelated_share": line.share,
        "readings": len(found.readings.value),
        "places": int(found.readings.place.max()) + 1,
        "place_m": found.readings.place_m,
        "spots": line.spots,
        "effective_spots": line.effective,
        "anchors": found.anchors,
        "held_out": found.scores,
        "next_places": found.advice,
    }


def _sheets(world: World, found: RadioCalibration) -> list[Sheet]:
    readings, line, unit = found.readings, found.line, UNITS[found.kind]
    count = int(readings.place.max()) + 1
    title = f"{found.kind}: {len(readings.value)} readings at {count} places of {readings.place_m:.2g} m"
    rows = [
        (GAINS[found.kind], line.gain_interval().text(3)),
        (f"{LEVELS[found.kind]}, mean of the anchors", line.level_interval().text(3)),
        (f"anchors' levels apart, {unit}", f"{line.level_std_between:.2f}"),
        (f"σ of one reading, {unit}", f"{found.std:.2f}"),
        (f"  of it within a place, {unit}", f"{found.spots.scatter:.2f}"),
        (f"  of it between places, {unit}", f"{line.place_std:.2f}"),
        ("  which stays alike over, m", f"{line.length_m:.2f}"),
        (f"spots of one anchor and place: {line.spots}, worth", f"{line.effective:.0f}"),
    ]
    head = "anchor", "places", GAINS[found.kind], LEVELS[found.kind], f"σ places, {unit}", "heard %"
    sheets = [
        Sheet(title, ("", "fit, 95 %"), tuple(rows)),
        Sheet("Each anchor by itself", head, tuple(_anchor_rows(world, found))),
    ]
    if found.scores:
        sheets.append(sheet(f"{found.kind} at places that were not fitted", found.scores))
    return sheets


def _anchor_rows(world: World, found: RadioCalibration) -> Iterator[tuple[str, ...]]:
    for anchor in world.anchors:
        fit = found.anchors[anchor.id]
        std = "–" if math.isnan(fit.place_std) else f"{fit.place_std:.2f}"
        heard = f"{100.0 * fit.heard:.0f}" if found.kind == "rssi" else "–"
        yield anchor.id, str(fit.places), _text(fit.gain), _text(fit.level), std, heard


def _text(interval: Interval | None) -> str:
    return "–" if interval is None else interval.text(2)


def _remarks(found: RadioCalibration) -> Iterator[str]:
    gain = found.line.gain_interval()
    if gain.reach > WIDE[found.kind]:
        yield (
            f"{found.kind}: {GAINS[found.kind]} and level can hardly be told apart, {gain.text(2)}: the readings are "
            "too few, or at too equal distances"
        )
    if found.kind == "rssi":
        for name, share in found.readings.heard.items():
            if share < SELDOM:
                yield (
                    f"rssi: {name} was heard in {100.0 * share:.0f} % of the scans; where only its strong readings are "
                    "heard, n comes out too low"
                )
    near = ", ".join(f"{each.distance_m:.1f} m" for each in found.advice)
    yield (
        f"{found.kind}: you need more places near d = {near}: they would bring the standard deviation of the "
        f"{GAINS[found.kind]} from {gain.std:.2g} to {found.advice[-1].gain_std:.2g}"
    )
    if not found.scores:
        yield f"{found.kind}: too few places to leave some out: nothing says how good this is"


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
    """Calibrate and tell."""
    return calibrate(arguments, partial(findings, points=arguments.points, place_m=arguments.place))
