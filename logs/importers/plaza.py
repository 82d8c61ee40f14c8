"""The Plaza sets: an autonomous mower outdoors with ranging radios, wheel odometry, gyro heading and RTK GPS.

Data: J. Djugash, B. Hamner, S. Roth, "Navigating with Ranging Radios: Five Data Sets with Ground Truth", Journal of
Field Robotics 2009; the MATLAB files come with GTSAM. Ranges in the file are not in time order; their stamps are right.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fusion import Measurement, Odometry, RangeReading, Ranges, RecordingError, Truth, World, wrap_angle
from fusion.values import nanoseconds
from logs.importers.foreign_recording import Recording
from logs.prior import prior_from_truth

RANGING = {"scale": 1.0693, "offset_m": 0.032, "std_m": 0.532}
NOISE = {
    # 0.05 of a step of 0.2 m and 3 degrees, as variance per metre and per radian
    "distance_std_per_sqrt_m": 0.022,
    "distance_std_per_sqrt_s": 0.002,
    "turn_std_per_sqrt_rad": 0.012,
    "turn_std_per_sqrt_s": 0.01,
}
COLUMNS = {"GT": 4, "DR": 3, "TL": 3, "TD": 4}


def recordings(folder: Path) -> Iterator[Recording]:
    """One run for every MATLAB file with the variables GT, DR, TL and TD."""
    files = sorted(folder.rglob("*.mat"))
    if not files:
        raise RecordingError(f"{folder}: no *.mat file; give the folder of a Plaza data set")
    for path in files:
        yield _recording(path)


def _load(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        tables = loadmat(path)
    except Exception as error:
        raise RecordingError(f"{path}: cannot be read as a MATLAB file ({error})") from error
    for name, columns in COLUMNS.items():
        if name not in tables or tables[name].ndim != 2 or tables[name].shape[1] != columns:
            raise RecordingError(f"{path}: no variable {name} with {columns} columns; is it a Plaza file?")
    return {name: tables[name].astype(float).tolist() for name in COLUMNS}


def _recording(path: Path) -> Recording:
    tables = _load(path)
    truths = [Truth(nanoseconds(t), x, y, wrap_angle(h)) for t, x, y, h in tables["GT"]]
    starts = [truths[0].time_ns, *(nanoseconds(row[0]) for row in tables["DR"])]
    odometry = [
        Odometry(nanoseconds(t), "odometry", i, min(starts[i], nanoseconds(t)), distance, turn)
        for i, (t, distance, turn) in enumerate(tables["DR"])
    ]
    ranges = [
        Ranges(nanoseconds(t), "ranging", i, (RangeReading(f"{int(beacon)}", far),))
        for i, (t, _, beacon, far) in enumerate(sorted(tables["TD"]))
    ]
    measurements: list[Measurement] = [*odometry, *ranges]
    prior, how = prior_from_truth(measurements, truths)
    table = {
        "name": path.stem.strip("_"),
        "provenance": "range scale, offset and noise were measured on Plaza1 (in-sample there)",
        "anchors": [{"id": f"{int(beacon)}", "position_m": [x, y]} for beacon, x, y in tables["TL"]],
        "ranging": RANGING,
        "robot": {"drive": "differential", "noise": NOISE},
    }
    about = {"source": "plaza", "licence": "cite Djugash, Hamner & Roth 2009", "prior": how}
    return Recording(str(table["name"]), World.from_table(table), prior, measurements, truths, about)
