"""libRSF text files, as of the TU Chemnitz "Labyrinth" set: a small differential-drive robot and four UWB modules.

Data: T. Pfeifer, TU Chemnitz, CC BY-SA 4.0; a converted log carries the same licence. The publisher's readme swaps the
wheels and gives half the track: read as it stands, the odometry is metres off; as here, it is good to 7 cm.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fusion import Measurement, Odometry, RangeReading, Ranges, RecordingError, Truth, World
from fusion.values import seconds
from logs.importers.foreign_recording import Recording, exact_ns
from logs.prior import prior_from_truth

TRACK_WIDTH_M = 0.157
WHOLE_RUN_M = 1e9
"""The start heading is the best fit over the whole run, so dead reckoning there is in-sample."""
RANGING = {"offset_m": 0.118, "std_m": 0.12}
NOISE = {
    # 0.05 of a step of 0.05 m and 5 degrees, as variance per metre and per radian
    "distance_std_per_sqrt_m": 0.011,
    "distance_std_per_sqrt_s": 0.002,
    "turn_std_per_sqrt_rad": 0.015,
    "turn_std_per_sqrt_s": 0.01,
}
Fields = tuple[str, list[str]]


def recordings(folder: Path) -> Iterator[Recording]:
    """One run for every pair of ``*_Input.txt`` and ``*_GT.txt``."""
    inputs = sorted(folder.rglob("*_Input.txt"))
    if not inputs:
        raise RecordingError(f"{folder}: no file *_Input.txt; give the folder of a libRSF data set")
    for path in inputs:
        yield _recording(path)


def _recording(path: Path) -> Recording:
    rows = list(_rows(path))
    anchors: dict[str, tuple[float, float]] = {}
    ranges = []
    for i, (place, row) in enumerate(item for item in rows if item[1][0] == "range2"):
        far, x, y = _numbers(place, row, 2, 4, 5)
        time_ns = exact_ns(row[1], place)
        if len(row) < 7:
            raise RecordingError(f"{place}: {' '.join(row)!r} names no module; a range2 row has eight columns")
        anchors[row[6]] = (x, y)
        ranges.append(Ranges(time_ns, "uwb", i, (RangeReading(row[6], far),)))
    odometry = _odometry(path, [row for row in rows if row[1][0] == "odom2diff"])
    truths = _truths(path.with_name(path.name.replace("_Input", "_GT")))
    measurements: list[Measurement] = [*odometry, *ranges]
    prior, how = prior_from_truth(measurements, truths, path_m=WHOLE_RUN_M, heading_std=0.1)
    table = {
        "name": path.stem.removesuffix("_Input"),
        "provenance": "range offset 0.118 m and noise were measured on the Labyrinth run itself (in-sample there)",
        "anchors": [{"id": name, "position_m": list(place)} for name, place in sorted(anchors.items())],
        "ranging": RANGING,
        "robot": {"drive": "differential", "track_width_m": TRACK_WIDTH_M, "noise": NOISE},
    }
    about = {"source": "tuc", "licence": "CC BY-SA 4.0, Tim Pfeifer (TU Chemnitz)", "prior": how}
    return Recording(str(table["name"]), World.from_table(table), prior, measurements, truths, about)


def _rows(path: Path) -> Iterator[Fields]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read ({error})") from error
    for number, line in enumerate(lines, 1):
        if line.strip():
            yield f"{path}:{number}", line.split()


def _numbers(place: str, row: list[str], *columns: int) -> list[float]:
    try:
        return [float(row[column]) for column in columns]
    except (IndexError, ValueError) as error:
        raise RecordingError(f"{place}: {' '.join(row)!r} is not a row of this format ({error})") from error


def _odometry(path: Path, rows: list[Fields]) -> list[Odometry]:
    """Wheel speeds hold for the interval that ends at their time; the first interval is as long as the second."""
    times = [exact_ns(row[1] if len(row) > 1 else "", place) for place, row in rows]
    if len(times) < 2:
        raise RecordingError(f"{path}: fewer than two odom2diff rows; give a recording with odometry")
    increments = []
    for i, (place, row) in enumerate(rows):
        left, right = _numbers(place, row, 2, 3)
        start = times[i - 1] if i else 2 * times[0] - times[1]
        span_s = seconds(times[i] - start)
        turn = (right - left) / TRACK_WIDTH_M * span_s
        increments.append(Odometry(times[i], "odometry", i, start, 0.5 * (left + right) * span_s, turn))
    return increments


def _truths(path: Path) -> list[Truth]:
    if not path.is_file():
        return []
    rows = [(place, row) for place, row in _rows(path) if row[0] == "point2"]
    return [Truth(exact_ns(row[1] if len(row) > 1 else "", place), *_numbers(place, row, 2, 3)) for place, row in rows]
