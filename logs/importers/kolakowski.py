"""Kolakowski's BLE runs: a six-wheeled robot in a flat, a BLE tag on it, six anchors, position from the robot's LiDAR.

Data: M. Kolakowski, "Automated Calibration of RSS Fingerprinting Based Systems Using a Mobile Robot and Machine
Learning", Sensors 2021, 21, 6270; CC BY 4.0. Odometry means motion commands: there are no encoders. Poses are given in
the mapping frame, turned 179 degrees against the flat; the tag sits 14 cm behind the robot, 1.3 m up.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

from fusion import Measurement, Odometry, Pose, RecordingError, RssiReading, Truth, WifiScan, World
from fusion.values import NANOSECONDS, nanoseconds, seconds
from logs.importers.foreign_recording import Recording, Row, exact_ns, read_table
from logs.prior import prior_from_truth

FLAT_FROM_MAPPING = Pose(0.46076947, 6.34292452, math.radians(179.0))
TAG_ON_ROBOT_M = (-0.14, 0.01, 1.3)
SPEEDS = {
    # forward [m/s], turn [rad/s], as measured behind the commands of runs 1 to 3
    "forward": (0.290, 0.0),
    "reverse": (-0.290, 0.0),
    "left": (0.0, 1.361),
    "right": (0.0, -1.313),
    "stop": (0.0, 0.0),
}
STEP_NS = nanoseconds(0.1)
PATH_LOSS = {
    # RSSI at 1 m [dBm], path-loss exponent, sigma [dB] by anchor
    "1": (-51.32, 1.678, 7.78),
    "2": (-40.79, 3.180, 6.18),
    "3": (-46.88, 1.882, 5.07),
    "4": (-41.83, 2.345, 7.14),
    "5": (-41.80, 3.147, 6.16),
    "6": (-44.01, 2.192, 6.94),
}
POOLED = (-46.8, 2.08, 7.03)
TIME_CORRELATION = 1.25
"""Errors of neighbouring readings are correlated: 1.6 times the fitted sigma in all, sqrt(1 + 1.25^2)."""
RSSI_COLUMNS = {"rssi_3": "1", "rssi_4": "2", "rssi_5": "3", "rssi_8": "4", "rssi_10": "5", "rssi_11": "6"}
NOISE = {
    # 0.20 of a step of 0.03 m; 0.40 of a commanded turn of 0.4 rad (a third of a second)
    "distance_std_per_sqrt_m": 0.035,
    "distance_std_per_sqrt_s": 0.03,
    "turn_std_per_sqrt_rad": 0.25,
    "turn_std_per_sqrt_s": 0.01,
    "turn_bias_std_rad_s": 0.0,
    "turn_scale_std": 0.05,
}
LAST_GOOD_NS = 1628001747456333000
"""Time at which the publication stops using the third run; what follows in that file is left out here too."""


def recordings(folder: Path) -> Iterator[Recording]:
    """One run for every ``*_df.csv`` with its ``*_motion.txt``, if there is one."""
    files = sorted(folder.rglob("*_df.csv"))
    if not files:
        raise RecordingError(f"{folder}: no *_df.csv; give the folder of the BLE data set")
    anchors = next(iter(sorted(folder.rglob("anchors.csv")) or sorted(folder.parent.glob("anchors.csv"))), None)
    if anchors is None:
        raise RecordingError(f"{folder}: no anchors.csv; give the folder that holds it")
    for path in files:
        yield _recording(path, anchors)


def _recording(path: Path, anchors: Path) -> Recording:
    rows = list(read_table(path, ["ts", "x", "y", "heading"]))
    if not rows:
        raise RecordingError(f"{path}: no row beside the header; give a whole file")
    if _time_ns(rows[0]) < LAST_GOOD_NS < _time_ns(rows[-1]):
        rows = [row for row in rows if _time_ns(row) <= LAST_GOOD_NS]
    truths = [_truth(row) for row in rows]
    scans = [scan for i, row in enumerate(rows) if (scan := _scan(i, row)).readings]
    motion = path.with_name(path.name.replace("_df.csv", "_motion.txt"))
    odometry = _odometry(motion, truths[0].time_ns, truths[-1].time_ns) if motion.is_file() else []
    measurements: list[Measurement] = [*odometry, *scans]
    prior, how = prior_from_truth(measurements, truths)
    name = path.name.removesuffix("_df.csv")
    about = {"source": "kolakowski", "licence": "CC BY 4.0, M. Kolakowski, doi 10.3390/s21186270", "prior": how}
    world = _world(name, anchors, "differential" if odometry else "none")
    return Recording(name, world, prior, measurements, truths, about)


def _time_ns(row: Row) -> int:
    return row.time_ns("ts") // NANOSECONDS


def _truth(row: Row) -> Truth:
    pose = FLAT_FROM_MAPPING.compose(Pose(row.number("x"), row.number("y"), row.number("heading")))
    return Truth(_time_ns(row), pose.x, pose.y, pose.heading)


def _scan(seq: int, row: Row) -> WifiScan:
    received = [(anchor, row.number(name)) for name, anchor in RSSI_COLUMNS.items() if row.text(name)]
    return WifiScan(_time_ns(row), "ble", seq, tuple(RssiReading(anchor, rssi) for anchor, rssi in received))


def _odometry(path: Path, start_ns: int, end_ns: int) -> list[Odometry]:
    """The commands, each holding until the next, as increments of at most a tenth of a second."""
    commands = _commands(path)
    edges = {start_ns, end_ns, *(time for time, _ in commands if start_ns < time < end_ns)}
    edges.update(range(start_ns, end_ns, STEP_NS))
    times = sorted(edges)
    increments, current = [], "stop"
    upcoming = iter([*commands, (end_ns + 1, "stop")])
    following = next(upcoming)
    for i, (before, time) in enumerate(itertools.pairwise(times)):
        while following[0] <= before:
            current = following[1]
            following = next(upcoming, (end_ns + 1, "stop"))
        speed, rate = SPEEDS[current]
        span_s = seconds(time - before)
        increments.append(Odometry(time, "commands", i, before, speed * span_s, rate * span_s))
    return increments


def _commands(path: Path) -> list[tuple[int, str]]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read ({error}); it belongs beside the _df.csv") from error
    commands = []
    for number, line in enumerate(lines, 1):
        parts = line.split(",")
        if not line.strip():
            continue
        if len(parts) < 2 or parts[1] not in SPEEDS:
            raise RecordingError(f"{path}:{number}: {line!r} is no command; expected time,{'|'.join(SPEEDS)},speed")
        commands.append((exact_ns(parts[0], f"{path}:{number}"), parts[1]))
    return commands


def _world(name: str, path: Path, drive: str) -> World:
    anchors = []
    for row in read_table(path, ["id", "x", "y", "z"]):
        anchor = row.text("id")
        rssi_dbm, exponent, sigma_db = PATH_LOSS.get(anchor, POOLED)
        radio = {
            "reference_rssi_dbm": rssi_dbm,
            "path_loss_exponent": exponent,
            "shadowing_std_db": sigma_db,
            "bias_std_db": TIME_CORRELATION * sigma_db,
        }
        place = [row.number("x"), row.number("y"), row.number("z")]
        anchors.append({"id": anchor, "position_m": place, "radio": radio})
    return World.from_table(
        {
            "name": name,
            "provenance": "path loss and command speeds were fitted on calibration runs 1 to 3 (in-sample there)",
            "anchors": anchors,
            "robot": {"drive": drive, "antenna_m": list(TAG_ON_ROBOT_M), "noise": NOISE},
        }
    )
