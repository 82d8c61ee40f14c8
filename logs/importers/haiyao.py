"""Haiyao Yu's Wi-Fi round-trip-time circuits: phones carried past six access points, ranges and signal strength.

Data: github.com/haiyaoyu/RTT-Indoor-localization-data-set, MIT, Copyright (c) 2022 haiyaoyu. There is no odometry: the
filters carry a random walk between readings. An access point that did not answer has zeros; on a regular grid a value
equal to the one before was held, not measured.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path

from fusion import RangeReading, Ranges, RecordingError, RssiReading, Truth, WifiScan, World
from fusion.values import nanoseconds
from logs.importers.foreign_recording import Recording, Row, read_table
from logs.prior import prior_from_truth

RANGING = {"offset_m": 1.5, "std_m": 1.5, "bias_std_m": 1.0}
RADIO = {"reference_rssi_dbm": -42.3, "path_loss_exponent": 1.82, "shadowing_std_db": 5.6, "bias_std_db": 5.6}
NOISE = {"drift_std_per_sqrt_s": 0.1, "turn_drift_std_per_sqrt_s": 0.0}


def recordings(folder: Path) -> Iterator[Recording]:
    """One run for every CSV file below a folder with an ``AP_idx_*.csv``."""
    maps = sorted(folder.rglob("AP_idx_*.csv")) or sorted(folder.parent.glob("AP_idx_*.csv"))
    if not maps:
        raise RecordingError(f"{folder}: no AP_idx_*.csv with the access points' places; give the building's folder")
    for places in maps:
        below = places.parent if len(maps) > 1 or folder in places.parents else folder
        runs = sorted(path for path in below.rglob("*.csv") if not path.name.startswith("AP_idx"))
        for path in runs:
            yield _recording(path, places)


def _recording(path: Path, places: Path) -> Recording:
    anchors = {row.text(""): [row.number("x"), row.number("y")] for row in read_table(places, ["x", "y"])}
    rows = list(read_table(path, [f"{anchor} RTT Distance (m)" for anchor in anchors]))
    if not rows:
        raise RecordingError(f"{path}: no row beside the header; give a whole file")
    clock = next((name for name in rows[0].cells if name.endswith("Time Stamp (ms)")), "")
    where = next((name for name in rows[0].cells if name.endswith("Ground Truth")), "")
    if not clock:
        raise RecordingError(f"{path}: no column ending in 'Time Stamp (ms)'; is it a file of this set?")
    times = [nanoseconds(row.number(clock) / 1000.0) for row in rows]
    truths = [_truth(time, row, where) for time, row in zip(times, rows, strict=True) if row.text(where)]
    measurements: list[Ranges | WifiScan] = []
    for i, (time, row) in enumerate(zip(times, rows, strict=True)):
        measurements += _readings(time, i, row, rows[i - 1] if i else None, list(anchors))
    prior, how = prior_from_truth(measurements, truths)
    name = f"{places.stem.removeprefix('AP_idx_')}-{path.parent.name}-{path.stem}"
    table = {
        "name": name,
        "provenance": "range offset, noise and path loss were measured on the Canteen circuits (in-sample there)",
        "anchors": [{"id": anchor, "position_m": place} for anchor, place in anchors.items()],
        "ranging": RANGING,
        "radio": RADIO,
        "robot": {"drive": "none", "noise": NOISE},
    }
    about = {"source": "haiyao", "licence": "MIT, haiyaoyu", "prior": how}
    return Recording(name, World.from_table(table), prior, measurements, truths, about)


def _truth(time_ns: int, row: Row, column: str) -> Truth:
    try:
        x, y = ast.literal_eval(row.text(column))
        return Truth(time_ns, float(x), float(y))
    except (ValueError, TypeError, SyntaxError) as error:
        raise RecordingError(f"{row.place}: {column} is {row.text(column)!r}, expected [x, y]") from error


def _readings(
    time_ns: int, seq: int, row: Row, before: Row | None, anchors: Sequence[str]
) -> Iterator[Ranges | WifiScan]:
    """New measurements of one row. Ranges have ten digits, so an equal one was held; whole dBm may repeat."""
    ranges, rssi = [], []
    for anchor in anchors:
        columns = [f"{anchor} RTT Distance (m)", f"{anchor} RSS (dBm)"]
        far_held, strength_held = (before is not None and row.text(name) == before.text(name) for name in columns)
        far, strength = (row.number(name) if row.text(name) else 0.0 for name in columns)
        if far != 0.0 and not far_held:
            ranges.append(RangeReading(anchor, far))
        if strength != 0.0 and not (far_held and strength_held):
            rssi.append(RssiReading(anchor, strength))
    if ranges:
        yield Ranges(time_ns, "rtt", seq, tuple(ranges))
    if rssi:
        yield WifiScan(time_ns, "rss", seq, tuple(rssi))
