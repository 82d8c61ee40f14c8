"""Tracks out of files: TUM, CSV, or a log's truth and recorded estimates, as columns and with every nanosecond."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import IO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.estimate_track import Track
from fusion import FusionError, LogError
from fusion.arrays import Flags, Floats, Whole
from fusion.errors import did_you_mean
from fusion.values import NANOSECONDS
from logs.importers.foreign_recording import exact_ns
from logs.reader import read_run
from logs.run import left_out
from logs.truth import TruthTrack

Columns: TypeAlias = tuple[Whole, Floats, Floats, Floats]

CSV_COLUMNS = ("time_s", "x_m", "y_m", "heading_rad")
TUM_COLUMNS = "time x y z qx qy qz qw"
TIME_WIDTH = 32
"""Longest time in seconds that is read, in characters."""
MOST_SECONDS = 9e9
"""Later is no time in seconds: 64 bits of nanoseconds end in the year 2262."""


def read_truth(source: str | Path) -> tuple[TruthTrack, tuple[str, ...]]:
    """The true poses in a TUM or CSV file, or in a log, and in sentences what is left out; raises `LogError`."""
    path = Path(source)
    if path.suffix == ".mcap":
        run = read_run(path)
        truth, warnings = run.truth, run.warnings
    else:
        columns = _read_text(path)
        placed = _placed(columns)
        truth = TruthTrack(*columns).at(placed)
        warnings = tuple(f"{path}: {sentence}" for sentence in left_out(placed.tolist()))
    if not truth:
        raise LogError("; ".join([*warnings, f"{path}: holds no ground truth; give a log or a file that does"]))
    return truth, warnings


def read_track(source: str | Path) -> Track:
    """Estimates out of a TUM or CSV file, or out of a log that `fusion replay` wrote: ``run.mcap:ekf``,
    or ``run.mcap`` where it holds one estimator's answers only; raises `LogError`.
    """
    path, colon, name = str(source).rpartition(":")
    if not (colon and path.endswith(".mcap")):
        path, name = str(source), ""
    if path.endswith(".mcap"):
        return _read_lane(Path(path), name)
    columns = _read_text(Path(path))
    _refuse(Path(path), ~_placed(columns), "holds no position; remove the row")
    return Track.of_poses(*columns)


def _read_lane(path: Path, name: str) -> Track:
    lanes = read_run(path).lanes
    if not lanes:
        raise LogError(f"{path}: holds no estimates; add some with `fusion replay`")
    if not name and len(lanes) > 1:
        raise LogError(f"{path}: holds estimates of {', '.join(sorted(lanes))}; choose one, as in {path}:{min(lanes)}")
    chosen = name or next(iter(lanes))
    if chosen not in lanes:
        raise LogError(f"{path}: holds no estimates of {chosen!r}; {did_you_mean(chosen, lanes)}")
    return Track.of_estimates(lanes[chosen])


def _placed(columns: Columns) -> Flags:
    """Whether each pose has a position."""
    _, x, y, _ = columns
    return np.isfinite(x) & np.isfinite(y)


def _read_text(path: Path) -> Columns:
    """Time [ns], x, y [m], heading [rad], NaN where they are not known, of a TUM or CSV file."""
    try:
        rows = _read_csv(path) if path.suffix == ".csv" else _read_tum(path)
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: cannot be read ({error}); give a TUM, CSV or MCAP file") from error
    time_ns, x, y, heading = rows
    if len(time_ns) == 0:
        raise LogError(f"{path}: holds no pose; give another file")
    back = np.flatnonzero(np.diff(time_ns) <= 0)
    if len(back):
        raise LogError(f"{path}: pose {int(back[0]) + 2} is not later than the one before it; sort the file by time")
    return time_ns, x, y, heading


def _read_tum(path: Path) -> Columns:
    """Of a quaternion of zeros or NaN, which is no rotation, no heading is known."""
    with path.open(encoding="utf-8") as stream:
        time_ns, table = _parse(path, stream, 7, TUM_COLUMNS, None)
    x, y, _, qx, qy, qz, qw = table.T
    # A quaternion of any length is the rotation of the one of length 1.
    heading = np.arctan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    return time_ns, x, y, np.where(table[:, 3:].any(axis=1), heading, np.nan)


def _read_csv(path: Path) -> Columns:
    head, _, body = path.read_text(encoding="utf-8-sig").partition("\n")
    names = tuple(head.strip().split(","))
    if names not in (CSV_COLUMNS, CSV_COLUMNS[:3]):
        raise LogError(f"{path}: the first line must be {','.join(CSV_COLUMNS)} (heading_rad may be missing)")
    # An empty cell is a number that is not known.
    body = body.replace("\r\n", "\n").replace(",\n", ",nan\n") + ("nan" if body.endswith(",") else "")
    body = body.replace(",,", ",nan,").replace(",,", ",nan,")
    time_ns, table = _parse(path, io.StringIO(body), len(names) - 1, ",".join(names), ",")
    heading = table[:, 2] if len(names) > 3 else np.full(len(table), np.nan)
    return time_ns, table[:, 0], table[:, 1], heading


def _refuse(path: Path, bad: Flags | np.bool_, why: str) -> None:
    if np.any(bad):
        raise LogError(f"{path}: pose {int(np.argmax(bad)) + 1} {why}")


def _parse(path: Path, text: IO[str], numbers: int, columns: str, separator: str | None) -> tuple[Whole, Floats]:
    """Times [ns] (n,) and the other columns (n, ``numbers``) of a table; lines that start with # are comments."""
    row = np.dtype([("time", f"S{TIME_WIDTH}"), ("numbers", np.float64, (numbers,))])
    try:
        with warnings.catch_warnings():
            # Of a file without rows numpy warns, and we raise a little later.
            warnings.simplefilter("ignore", UserWarning)
            table = np.loadtxt(text, dtype=row, delimiter=separator, ndmin=1)
    except ValueError as error:
        raise LogError(f"{path}: is not a table of {columns} ({error}); correct it") from error
    found = np.ascontiguousarray(table["numbers"])
    _refuse(path, np.isinf(found).any(axis=1), "holds a number that is infinite; write nan where it is not known")
    return _times_ns(path, table["time"]), found


def _times_ns(path: Path, texts: NDArray[np.bytes_]) -> Whole:
    """Decimal seconds as whole nanoseconds, exactly: a float of today's time is right to 200 ns only.

    Column by column of characters, all rows at once; what is not plain digits and one point is left to `exact_ns`.
    """
    characters = np.ascontiguousarray(texts).view(np.uint8).reshape(-1, TIME_WIDTH)
    value, decimals = np.zeros(len(texts), dtype=np.int64), np.full(len(texts), -1)
    plain = characters.any(axis=1)
    for column in characters[:, characters.any(axis=0)].T:
        digit = (column >= ord("0")) & (column <= ord("9"))
        point = (column == ord(".")) & (decimals < 0)
        plain &= digit | point | (column == 0)
        taken = digit & (decimals < 9)
        value = np.where(taken, value * 10 + (column - ord("0")), value)
        decimals += np.where(decimals < 0, point, taken)
        plain &= (decimals >= 0) | (value <= MOST_SECONDS)
    time_ns = np.asarray(value * 10 ** (9 - np.maximum(decimals, 0)))
    for row in np.flatnonzero(~plain):
        time_ns[row] = _odd_time_ns(path, texts[row].decode(errors="replace"), int(row) + 1)
    return time_ns


def _odd_time_ns(path: Path, text: str, row: int) -> int:
    if len(text) == TIME_WIDTH:
        raise LogError(f"{path}: pose {row}: a time of {TIME_WIDTH} characters or more; nine decimals are enough")
    try:
        time_ns = exact_ns(text, f"{path}: pose {row}")
    except FusionError as error:
        raise LogError(str(error)) from error
    if abs(time_ns) > MOST_SECONDS * NANOSECONDS:
        raise LogError(f"{path}: pose {row}: {text} is no time in seconds; divide it by a power of 1000")
    return time_ns
