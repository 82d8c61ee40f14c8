"""HeRoLab's CDOA runs: a TurtleBot3 on a table, four Wi-Fi nodes at its corners, one CSV row a second.

Data: E. Latif, R. Parasuraman, "Instantaneous Wireless Robotic Node Localization Using Collaborative Direction of
Arrival", IEEE Internet of Things Journal 2023; MIT. The encoders give distance only and read short; the turn is what
was commanded. Each row holds the last value of everything, so positions may be a second old.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from fusion import Measurement, Odometry, RecordingError, RssiReading, Truth, WifiScan, World
from fusion.values import NANOSECONDS, seconds
from logs.importers.foreign_recording import Recording, Row, read_table
from logs.prior import prior_from_truth

DISTANCE_SCALE = 1.178
START_PATH_M = 0.8
NODES = {
    # position [m], RSSI at 1 m [dBm], path-loss exponent, sigma [dB]
    "1": ((0.0, 0.0), -38.70, 1.538, 3.96),
    "2": ((0.0, 1.75), -37.28, 1.326, 4.37),
    "3": ((2.34, 1.75), -38.96, 1.277, 4.03),
    "4": ((2.34, 0.0), -40.76, 1.379, 4.67),
}
REFERENCE_DISTANCE_M = 0.1
"""The runs stay within 0.1 to 3 m of the nodes, and the log-distance fit holds over all of it."""
TIME_CORRELATION = 1.25
"""Errors of neighbouring scans are correlated: 1.6 times the fitted sigma in all, sqrt(1 + 1.25^2)."""
NOISE = {
    # 0.10 of a step of 0.1 m; 0.40 of a commanded turn of up to 0.8 rad in a second
    "distance_std_per_sqrt_m": 0.03,
    "distance_std_per_sqrt_s": 0.005,
    "turn_std_per_sqrt_rad": 0.35,
    "turn_std_per_sqrt_s": 0.03,
    "distance_scale_std": 0.05,
}
FROZEN_M = 0.02
"""Encoder motion from which an unchanged true position counts as frozen [m]."""


def recordings(folder: Path) -> Iterator[Recording]:
    """One run for every ``combined_sync_data_*.csv``, however short."""
    files = sorted(folder.rglob("combined_sync_data_*.csv"))
    if not files:
        raise RecordingError(f"{folder}: no combined_sync_data_*.csv; give a folder of CDOA runs")
    for path in files:
        yield _recording(path)


def _recording(path: Path) -> Recording:
    wanted = ["temp_sec", "temp_nsec", "robot_odom_x", "robot_pos_x", "robot_pos_y", "vel_w", "status4"]
    rows = list(read_table(path, wanted))
    whole = [row for row in rows if _is_whole(row)]
    if not whole:
        raise RecordingError(f"{path}: no whole row beside the header; give a whole file")
    odometry, truths = _odometry(whole), _truths(whole)
    scans = [scan for i, row in enumerate(whole) if (scan := _scan(i, row)).readings]
    measurements: list[Measurement] = [*odometry, *scans]
    prior, how = prior_from_truth(measurements, truths, path_m=START_PATH_M)
    about = {"source": "cdoa", "licence": "MIT, HeRoLab UGA", "prior": how}
    if len(whole) < len(rows):
        about["skipped"] = f"{len(rows) - len(whole)} rows cut off or without a number"
    name = f"{path.parent.name}-{path.stem.removeprefix('combined_sync_data_')}"
    return Recording(name, _world(name), prior, measurements, truths, about)


def _world(name: str) -> World:
    anchors = [
        {
            "id": node,
            "position_m": list(place),
            "radio": {
                "reference_distance_m": REFERENCE_DISTANCE_M,
                "reference_rssi_dbm": rssi_dbm + 10.0 * exponent,
                "path_loss_exponent": exponent,
                "shadowing_std_db": sigma_db,
                "bias_std_db": TIME_CORRELATION * sigma_db,
            },
        }
        for node, (place, rssi_dbm, exponent, sigma_db) in NODES.items()
    ]
    return World.from_table(
        {
            "name": name,
            "provenance": "path loss and distance scale were fitted on six of these runs (in-sample there)",
            "anchors": anchors,
            "bounds": {"x_min": -0.5, "x_max": 2.84, "y_min": -0.5, "y_max": 2.25},
            "robot": {"drive": "differential", "noise": NOISE},
        }
    )


def _is_whole(row: Row) -> bool:
    """Whether a row reaches its last column and its motion and truth are numbers."""
    columns = ("robot_odom_x", "robot_pos_x", "robot_pos_y", "vel_w")
    return bool(row.text("status4")) and all(math.isfinite(row.number(column)) for column in columns)


def _time_ns(row: Row) -> int:
    return row.whole("temp_sec") * NANOSECONDS + row.whole("temp_nsec")


def _odometry(rows: Sequence[Row]) -> list[Odometry]:
    """Distance from the encoder; turn from the mean of the commands at both ends of a row's second."""
    increments = []
    for i, (before, row) in enumerate(itertools.pairwise(rows)):
        start, time_ns = _time_ns(before), _time_ns(row)
        distance = DISTANCE_SCALE * (row.number("robot_odom_x") - before.number("robot_odom_x"))
        turn = 0.5 * (row.number("vel_w") + before.number("vel_w")) * seconds(time_ns - start)
        increments.append(Odometry(time_ns, "odometry", i, start, distance, turn))
    return increments


def _scan(seq: int, row: Row) -> WifiScan:
    """Zero dBm or status 0 means no reading."""
    received = [node for node in NODES if row.number(f"rssi{node}") != 0.0 and row.number(f"status{node}") == 1.0]
    readings = tuple(RssiReading(node, row.number(f"rssi{node}")) for node in received)
    return WifiScan(_time_ns(row), "wifi", seq, readings)


def _truths(rows: Sequence[Row]) -> list[Truth]:
    """Positions, but for rows in which the camera froze while the encoder moved."""
    truths = []
    for before, row in zip([rows[0], *rows], rows, strict=False):
        here = (row.number("robot_pos_x"), row.number("robot_pos_y"))
        still = here == (before.number("robot_pos_x"), before.number("robot_pos_y")) and row is not before
        moved = abs(row.number("robot_odom_x") - before.number("robot_odom_x")) > FROZEN_M
        if not (still and moved):
            truths.append(Truth(_time_ns(row), *here))
    return truths
