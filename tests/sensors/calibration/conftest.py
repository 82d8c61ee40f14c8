"""Runs whose true calibration is known: another gyro in a drive, and readings put together by hand."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from fusion import Gyro, RssiReading, Truth, WifiScan, World
from logs.run import Run
from logs.truth import TruthTrack
from tests.sensors.simulated_drive import ANCHORS


def _scaled_gyro(run, scale, bias):
    """The run with a gyro that reads (true / scale) + bias."""
    measurements = tuple(
        dataclasses.replace(m, rate_rad_s=m.rate_rad_s / scale + bias) if isinstance(m, Gyro) else m
        for m in run.measurements
    )
    return dataclasses.replace(run, measurements=measurements)


def _rssi_run(points, values, *, world=None, turned=0.0, each=5):
    """A run that stands ``each`` scans at every point (n, 2) and receives the anchors at ``values`` (n, anchors)."""
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
            readings = tuple(RssiReading(a["id"], float(v)) for a, v in zip(anchors, received, strict=True))
            scans.append(WifiScan(time, "wifi", i * each + k, readings))
            truths.append(Truth(time, float(point[0]), float(point[1]), 0.0))
    track = TruthTrack.from_truths(truths)
    return Run(Path("made.mcap"), "made", place, None, {}, tuple(scans), track, (), {})


@pytest.fixture(scope="session")
def scaled_gyro():
    """Gives a run another gyro scale and bias."""
    return _scaled_gyro


@pytest.fixture(scope="session")
def rssi_run():
    """A run from surveyed points and the values received there."""
    return _rssi_run
