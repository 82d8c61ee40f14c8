"""`fusion export`: a log as CSV (the bundle that `fusion import csv` reads) or as TUM tracks."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from fusion import Estimate, Gyro, LogError, Odometry, Ranges, WheelTicks, WifiScan
from fusion.values import NANOSECONDS
from logs.reader import read_run
from logs.run import Run
from logs.truth import TruthTrack

Cell = str | float | int


def seconds_text(time_ns: int) -> str:
    """Nanoseconds as seconds, every digit kept.

    >>> seconds_text(1652380260171842098)
    '1652380260.171842098'
    """
    whole, part = divmod(time_ns, NANOSECONDS)
    return f"{whole}.{part:09d}"


def export_csv(path: Path, folder: Path) -> list[Path]:
    """Write the CSV bundle of a log into ``folder``; answers the files. Numbers keep every digit.

    The bundle has no place for motor commands, the ages of readings in a scan, the prior, and names of sensors.
    """
    run = read_run(path)
    world = folder / "world.toml"
    _write_world(run, world)
    return [world, *(_write(folder / name, header, rows) for name, header, rows in _tables(run) if rows)]


def _write_world(run: Run, path: Path) -> None:
    import tomlkit

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(tomlkit.dumps(json.loads(run.world.table)), encoding="utf-8")
    except OSError as error:
        raise LogError(f"{path}: cannot be written ({error}); choose another folder") from error


def _tables(run: Run) -> Iterable[tuple[str, list[str], list[Sequence[Cell]]]]:
    """Name, header and rows of every file of the bundle."""
    kinds = run.measurements
    yield (
        "odometry.csv",
        ["time_s", "distance_m", "turn_rad"],
        [(seconds_text(m.time_ns), m.distance_m, m.turn_rad) for m in kinds if isinstance(m, Odometry)],
    )
    ticks = [m for m in kinds if isinstance(m, WheelTicks)]
    wheels = [f"wheel{i + 1}" for i in range(len(ticks[0].counts) if ticks else 0)]
    yield "ticks.csv", ["time_s", *wheels], [(seconds_text(m.time_ns), *m.counts) for m in ticks]
    yield (
        "gyro.csv",
        ["time_s", "rate_rad_s"],
        [(seconds_text(m.time_ns), m.rate_rad_s) for m in kinds if isinstance(m, Gyro)],
    )
    yield (
        "ranges.csv",
        ["time_s", "anchor", "range_m", "std_m"],
        [
            (seconds_text(m.time_ns), r.anchor, r.range_m, "" if r.std_m is None else r.std_m)
            for m in kinds
            if isinstance(m, Ranges)
            for r in m.readings
        ],
    )
    yield (
        "rssi.csv",
        ["time_s", "anchor", "rssi_dbm"],
        [(seconds_text(m.time_ns), r.anchor, r.rssi_dbm) for m in kinds if isinstance(m, WifiScan) for r in m.readings],
    )
    poses = () if run.truth is None else _truth(run.truth)
    yield (
        "truth.csv",
        ["time_s", "x_m", "y_m", "heading_rad"],
        [(seconds_text(t), x, y, "" if math.isnan(heading) else heading) for t, x, y, heading in poses],
    )


def _truth(track: TruthTrack) -> Iterator[tuple[int, float, float, float]]:
    columns = (track.time_ns, track.x, track.y, track.heading)
    return zip(*(column.tolist() for column in columns), strict=True)


def export_tum(path: Path, folder: Path) -> list[Path]:
    """Write truth and recorded estimates as TUM files (time x y z qx qy qz qw) into ``folder``; answers the files.

    A heading that is not known is a quaternion of zeros, which is no rotation: `fusion bench score` reads it so.
    """
    run = read_run(path)
    tracks = {name: [_tum_of(estimate) for estimate in _last_words(lane)] for name, lane in run.lanes.items()}
    if run.truth is not None:
        tracks["truth"] = [_tum(*row) for row in _truth(run.truth)]
    if not tracks:
        raise LogError(f"{path}: holds neither truth nor estimates; add estimates with `fusion replay`")
    return [_write(folder / f"{name}.tum", None, rows, separator=" ") for name, rows in tracks.items()]


def _last_words(lane: Sequence[Estimate]) -> list[Estimate]:
    """In time order; of an estimate that late data made the estimator revise, the revision."""
    by_time = {estimate.time_ns: estimate for estimate in lane}
    return [by_time[time_ns] for time_ns in sorted(by_time)]


def _tum_of(estimate: Estimate) -> Sequence[Cell]:
    x, y, heading = estimate.pose
    return _tum(estimate.time_ns, x, y, heading if estimate.heading_known else math.nan)


def _tum(time_ns: int, x: float, y: float, heading: float) -> Sequence[Cell]:
    """A row; a heading of NaN is not known."""
    turned = (0.0, 0.0) if math.isnan(heading) else (math.sin(0.5 * heading), math.cos(0.5 * heading))
    return (seconds_text(time_ns), x, y, 0.0, 0.0, 0.0, *turned)


def _write(path: Path, header: list[str] | None, rows: Iterable[Sequence[Cell]], *, separator: str = ",") -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", encoding="utf-8", newline="") as stream:
            table = csv.writer(stream, delimiter=separator, lineterminator="\n")
            table.writerows([header] if header else [])
            table.writerows(rows)
    except OSError as error:
        raise LogError(f"{path}: cannot be written ({error}); choose another folder") from error
    return path


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion export`."""
    parser.add_argument("run", metavar="RUN", type=Path, help="the log")
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, required=True, help="where the files go")
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument("--csv", action="store_true", help="the bundle that `fusion import csv` reads")
    form.add_argument("--tum", action="store_true", help="tracks: truth, and what was recorded by `fusion replay`")


def run(arguments: argparse.Namespace) -> int:
    """Export and list what was written."""
    export = export_csv if arguments.csv else export_tum
    for path in export(arguments.run, arguments.output):
        sys.stdout.write(f"{path}\n")
    return 0
