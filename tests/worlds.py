"""Worlds and measurements that tests of several rooms use."""

import math

import numpy as np

from fusion import Odometry, Pose, RangeReading, Ranges, World
from fusion.values import NANOSECONDS as SECOND

PLACES = {"a": (0.0, 0.0), "b": (8.0, 0.0), "c": (1.0, 6.0), "d": (9.0, 7.0)}
"""Four anchors around a room [m]."""
START = Pose(4.0, 1.0, 0.2)
PLAIN_NOISE = {"distance_scale_std": 0.0, "turn_scale_std": 0.0, "turn_bias_std_rad_s": 0.0}
"""Odometry without calibration errors."""


def anchored_world(places=PLACES, **tables):
    """A world with anchors at ``places``, and further tables of a world file."""
    return World.from_table(
        {"anchors": [{"id": name, "position_m": list(at)} for name, at in places.items()], **tables}
    )


def empty_world(side_m=9.0, **tables):
    """A square floor without anchors."""
    return World.from_table({"bounds": {"x_min": 0, "x_max": side_m, "y_min": 0, "y_max": side_m}, **tables})


def ranged_world(places=PLACES, *, ranging=(), **tables):
    """A world of ranges with white noise of 0.2 m and no common errors, unless ``ranging`` states others."""
    return anchored_world(
        places, ranging={"std_m": 0.2, "bias_std_m": 0.0, "scale_std": 0.0, **dict(ranging)}, **tables
    )


def exact_ranges(time_ns, seq, position, names=None, places=PLACES):
    """Ranges without noise from a position to the anchors ``names``, or to all."""
    readings = (RangeReading(name, math.dist(position, places[name])) for name in names or places)
    return Ranges(time_ns, "uwb", seq, tuple(readings))


def circle(seconds=20, *, std_m=0.2, turn_rad=0.015, start=START, arm=(0.0, 0.0), outlier_at=None, places=PLACES):
    """A circle at 0.5 m/s: exact odometry at 10 Hz, ranges from the antenna to all anchors at 2 Hz, and the true poses
    at these; the first range of number ``outlier_at`` is 30 m too long.
    """
    random, pose, measurements, truth = np.random.default_rng(3), start, [], []
    for k in range(1, seconds * 10 + 1):
        t, middle = k * SECOND // 10, pose.heading + 0.5 * turn_rad
        pose = Pose(pose.x + 0.05 * math.cos(middle), pose.y + 0.05 * math.sin(middle), pose.heading + turn_rad)
        measurements.append(Odometry(t, "w", k, t - SECOND // 10, 0.05, turn_rad))
        if k % 5 == 0:
            at = pose.transform(*arm)
            far = {name: math.dist(at, place) + random.normal(0, std_m) for name, place in places.items()}
            far["a"] += 30.0 if k == outlier_at else 0.0
            measurements.append(Ranges(t, "uwb", k, tuple(RangeReading(name, z) for name, z in far.items())))
            truth.append(pose)
    return measurements, truth
