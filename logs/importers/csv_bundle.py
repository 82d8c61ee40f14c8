"""The plain CSV bundle: a folder that anybody can write. `docs/import.md` documents it."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator
from itertools import groupby, pairwise
from pathlib import Path

from fusion import (
    Gyro,
    Measurement,
    Odometry,
    RangeReading,
    Ranges,
    RecordingError,
    RssiReading,
    Truth,
    WheelTicks,
    WifiScan,
    World,
)
from logs.importers.foreign_recording import Recording, Row, read_table
from logs.prior import prior_from_truth
from logs.wheel_direction import caution_of_run


def recordings(folder: Path) -> Iterator[Recording]:
    """The one run of a bundle; raises `RecordingError` naming file and line."""
    if not (folder / "world.toml").is_file():
        raise RecordingError(f"{folder}: no world.toml; write one (docs/world.md shows every key)")
    world = World.load(folder / "world.toml")
    motion: list[Measurement] = [*_odometry(folder), *_ticks(folder), *_gyro(folder)]
    measurements = [*motion, *_ranges(folder), *_rssi(folder)]
    if not measurements:
        raise RecordingError(f"{folder}: none of odometry.csv, ticks.csv, ranges.csv, rssi.csv has a row; add one")
    truths = _truth(folder)
    prior, how = prior_from_truth(measurements, truths)
    caution, about = caution_of_run(world.robot, measurements, ()), {"source": "csv", "prior": how}
    doubts = [f"{folder}: {caution}"] if caution else []
    yield Recording(folder.resolve().name, world, prior, measurements, truths, about, warnings=doubts)


def _rows(folder: Path, name: str, *required: str) -> list[Row]:
    path = folder / name
    return list(read_table(path, required)) if path.is_file() else []


def _odometry(folder: Path) -> list[Odometry]:
    """Each row spans from the row before; the first is given the median span."""
    rows = _rows(folder, "odometry.csv", "time_s", "distance_m", "turn_rad")
    times = [row.time_ns("time_s") for row in rows]
    spans = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    before = [times[0] - int(statistics.median(spans or [0])), *times[:-1]] if rows else []
    return [
        Odometry(time, "odometry", i, min(start, time), row.number("distance_m"), row.number("turn_rad"))
        for i, (row, time, start) in enumerate(zip(rows, times, before, strict=True))
    ]


def _ticks(folder: Path) -> list[WheelTicks]:
    """Every column but the time is a wheel, in the wheel order of the world."""
    rows = _rows(folder, "ticks.csv", "time_s")
    return [
        WheelTicks(
            row.time_ns("time_s"), "ticks", i, tuple(row.whole(name) for name in row.cells if name and name != "time_s")
        )
        for i, row in enumerate(rows)
    ]


def _gyro(folder: Path) -> list[Gyro]:
    rows = _rows(folder, "gyro.csv", "time_s", "rate_rad_s")
    return [Gyro(row.time_ns("time_s"), "gyro", i, row.number("rate_rad_s")) for i, row in enumerate(rows)]


def _ranges(folder: Path) -> list[Ranges]:
    """Rows that follow each other with one time are one measurement."""
    rows = _rows(folder, "ranges.csv", "time_s", "anchor", "range_m")
    grouped = groupby(rows, key=lambda row: row.time_ns("time_s"))
    return [
        Ranges(
            time,
            "ranges",
            i,
            tuple(
                RangeReading(
                    row.text("anchor"), row.number("range_m"), row.number("std_m") if row.text("std_m") else None
                )
                for row in group
            ),
        )
        for i, (time, group) in enumerate(grouped)
    ]


def _rssi(folder: Path) -> list[WifiScan]:
    """Rows that follow each other with one time are one scan."""
    rows = _rows(folder, "rssi.csv", "time_s", "anchor", "rssi_dbm")
    grouped = groupby(rows, key=lambda row: row.time_ns("time_s"))
    return [
        WifiScan(time, "rssi", i, tuple(RssiReading(row.text("anchor"), row.number("rssi_dbm")) for row in group))
        for i, (time, group) in enumerate(grouped)
    ]


def _truth(folder: Path) -> list[Truth]:
    """Every row, also where no position is known: the log keeps it, and whoever reads it counts it."""
    return [
        Truth(row.time_ns("time_s"), *_place(row), row.optional("heading_rad"))
        for row in _rows(folder, "truth.csv", "time_s", "x_m", "y_m")
    ]


def _place(row: Row) -> tuple[float, float]:
    """A position [m], both NaN where either is not known."""
    x, y = row.optional("x_m"), row.optional("y_m")
    return (math.nan, math.nan) if x is None or y is None else (x, y)
