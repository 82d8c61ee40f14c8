"""A hall, and the path of a robot in it whose bags are imported."""

import math

from fusion import World

SECOND = 1_000_000_000
TABLE = {
    "name": "hall",
    "anchors": [{"id": name, "position_m": place} for name, place in (("a", [0, 0]), ("b", [5, 0]), ("c", [0, 5]))],
    "robot": {"drive": "differential", "wheel_circumference_m": math.tau * 0.1, "track_width_m": 0.5},
}
WORLD = World.from_table(TABLE)
POSES = ((1, 0.0, 0.0, 0.0), (2, 1.0, 0.0, 0.0), (3, 1.5, 0.5, math.pi / 2), (4, 1.5, 1.5, math.pi / 2))
"""Time [s] and pose of the robot's own odometry: straight on, a quarter circle, straight on."""
CHORD_M = math.sqrt(0.5)

GRAVITY = (0.0, 0.0, 9.81)
"""Acceleration measured by the IMU of the test bags [m/s²]."""


def of(run, kind):
    return [measurement for measurement in run.measurements if isinstance(measurement, kind)]
