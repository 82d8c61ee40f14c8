"""Runs whose true calibration is known: simulated drives, and readings put together by hand."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fusion import Gyro, RssiReading, Truth, WifiScan, World
from logs.run import Run
from logs.truth import TruthTrack
from sensors.simulation.scenario import Scenario
from sensors.simulation.simulate import simulated_run

ANCHORS = [
    {"id": "a", "position_m": [0.0, 0.0, 2.0]},
    {"id": "b", "position_m": [12.0, 0.0, 2.0]},
    {"id": "c", "position_m": [6.0, 9.0, 2.0]},
]
LINES = [[0.0, 0.0], [3.0, 0.0], [0.0, 0.0], [0.0, 2.0], [0.0, 0.0], [2.5, 0.0], [0.0, 2.5], [0.0, 0.0]]
SQUARES = [[3.0, 0.0], [3.0, 3.0], [0.0, 3.0], [0.0, 0.0], [0.0, 3.0], [3.0, 3.0], [3.0, 0.0], [0.0, 0.0]]
QUIET = {
    "distance_scale_std": 0.0,
    "track_scale_std": 0.0,
    "anchor_offset_std_db": 0.0,
    "gyro_hz": 0.0,
    "wifi_hz": 0.0,
}


def _drive(seed=0, *, waypoints=LINES + SQUARES, robot=None, laps=1, pause_s=1.0, **reality):
    table = {
        "world": {
            "anchors": ANCHORS,
            "robot": {"drive": "differential", "track_width_m": 0.3, "ticks_per_revolution": 200, **(robot or {})},
        },
        "route": {"waypoints_m": waypoints, "laps": laps, "pause_s": pause_s},
        "reality": {**QUIET, **reality},
    }
    return simulated_run(Scenario.from_table("drive", table), seed)


def _scaled_gyro(run, scale, bias):
    """The run with a gyro that reads (true / scale) + bias."""
    told = tuple(
        dataclasses.replace(m, rate_rad_s=m.rate_rad_s / scale + bias) if isinstance(m, Gyro) else m
        for m in run.measurements
    )
    return dataclasses.replace(run, measurements=told)


def _rssi_run(points, values, *, world=None, turned=0.0, each=5):
    """A run that stands ``each`` scans at every point (n, 2) and hears the anchors at ``values`` (n, anchors)."""
    c, s = np.cos(turned), np.sin(turned)
    spin = np.array([[c, -s], [s, c]])
    anchors = [
        {**row, "position_m": [*(spin @ row["position_m"][:2]).tolist(), row["position_m"][2]]}
        for row in (world or ANCHORS)
    ]
    place = World.from_table(
        {"anchors": anchors, "bounds": {"x_min": -20.0, "x_max": 20.0, "y_min": -20.0, "y_max": 20.0}}
    )
    scans, truths = [], []
    for i, (point, received) in enumerate(zip(np.asarray(points) @ spin.T, values, strict=True)):
        for k in range(each):
            time = (i * each + k) * 10**9
            told = tuple(RssiReading(a["id"], float(v)) for a, v in zip(anchors, received, strict=True))
            scans.append(WifiScan(time, "wifi", i * each + k, told))
            truths.append(Truth(time, float(point[0]), float(point[1]), 0.0))
    track = TruthTrack.from_truths(truths)
    return Run(Path("made.mcap"), "made", place, None, {}, tuple(scans), track, (), {})


@pytest.fixture(scope="session")
def drive():
    """A simulated drive of lines, spins and squares in both senses; noise by keyword."""
    return _drive


@pytest.fixture(scope="session")
def scaled_gyro():
    """Gives a run another gyro scale and bias."""
    return _scaled_gyro


@pytest.fixture(scope="session")
def rssi_run():
    """A run from surveyed points and the values received there."""
    return _rssi_run
