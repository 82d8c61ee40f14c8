"""A small run with known truth, against which the conformance kit holds estimators.

Four anchors around a room, a robot on a circle (or a straight line), wheels, ranges, signal strengths and a gyro. The
truth is a formula, so every test knows the right answer. The same run can be turned, moved, renamed, made noisy or
measured at another odometry rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fusion.geometry import Covariance, Pose, wrap_angle
from fusion.timeline import order
from fusion.values import (
    NANOSECONDS,
    Gyro,
    Measurement,
    Odometry,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    WifiScan,
    nanoseconds,
    seconds,
)
from fusion.world import World

ANCHORS = ((0.0, 0.0), (10.0, 0.5), (9.5, 8.0), (0.5, 7.5))
"""Places of the anchors [m], before the room is turned and moved."""
FLOOR = ((-2.0, -2.0), (12.0, 10.0))
"""Two opposite corners of the floor [m], before the room is turned and moved."""
NOISE_STD = (0.1, 2.0)
"""Noise of a range [m] and of a signal strength [dB], in a noisy run."""


@dataclass(frozen=True, slots=True)
class SyntheticRun:
    """Path of the robot, noise and rates of its sensors. ``map_from_room`` turns and moves everything together."""

    duration_s: float = 20.0
    speed_m_s: float = 0.5
    turn_rate_rad_s: float = 0.25
    start: Pose = Pose(5.0, 2.0, 0.0)
    map_from_room: Pose = Pose(0.0, 0.0, 0.0)
    anchor_names: tuple[str, ...] = ("a", "b", "c", "d")
    odometry_hz: int = 10
    noisy: bool = False
    radio_until_s: float = math.inf

    def pose(self, time_ns: int) -> Pose:
        """True pose of the robot."""
        elapsed_s, rate = seconds(time_ns), self.turn_rate_rad_s
        turned = rate * elapsed_s
        path_m = self.speed_m_s * elapsed_s
        chord_m = path_m * math.sin(0.5 * turned) / (0.5 * turned) if turned else path_m
        moved = Pose(chord_m * math.cos(0.5 * turned), chord_m * math.sin(0.5 * turned), wrap_angle(turned))
        return self.map_from_room.compose(self.start).compose(moved)

    def prior(self) -> Prior:
        """The true start, 0.1 m and 0.1 rad sure."""
        return Prior(0, self.pose(0), Covariance.from_std(0.1, 0.1, 0.1))

    def world(self) -> World:
        """The room."""
        (x1, y1), (x2, y2) = (self.map_from_room.transform(*corner) for corner in FLOOR)
        places = [self.map_from_room.transform(*place) for place in ANCHORS]
        rows = [{"id": name, "position_m": place} for name, place in zip(self.anchor_names, places, strict=True)]
        bounds = {"x_min": min(x1, x2), "x_max": max(x1, x2), "y_min": min(y1, y2), "y_max": max(y1, y2)}
        return World.from_table({"name": "drive", "anchors": rows, "bounds": bounds})

    def measurements(self) -> tuple[Measurement, ...]:
        """Everything measured, in time order: odometry, ranges at 2 Hz, a Wi-Fi scan and a gyro sample a second."""
        seconds_on = range(1, int(self.duration_s) + 1)
        gyro = [Gyro(second * NANOSECONDS, "gyro", second, self.turn_rate_rad_s) for second in seconds_on]
        measurements: list[Measurement] = [*self._odometry(), *self._radio(), *gyro]
        return tuple(sorted(measurements, key=order))

    def _odometry(self) -> list[Odometry]:
        period_ns = NANOSECONDS // self.odometry_hz
        distance_m, turn_rad = self.speed_m_s / self.odometry_hz, self.turn_rate_rad_s / self.odometry_hz
        return [
            Odometry(i * period_ns, "wheels", i, (i - 1) * period_ns, distance_m, turn_rad)
            for i in range(1, int(self.duration_s * self.odometry_hz) + 1)
        ]

    def _radio(self) -> list[Measurement]:
        world, random = self.world(), np.random.Generator(np.random.PCG64(7))
        scans: list[Measurement] = []
        for half in range(1, int(2.0 * min(self.duration_s, self.radio_until_s)) + 1):
            time_ns = nanoseconds(0.5 * half)
            x, y, _ = self.pose(time_ns)
            errors = random.standard_normal((2, len(ANCHORS))) * self.noisy
            # In the order of the room, not of the names: renaming must leave every anchor its own noise.
            anchors = [anchor for name in self.anchor_names if (anchor := world.anchor(name))]
            distances = [math.hypot(x - anchor.x, y - anchor.y) for anchor in anchors]
            ranges = tuple(
                RangeReading(anchor.id, float(anchor.ranging.expected(distance)) + NOISE_STD[0] * float(error))
                for anchor, distance, error in zip(anchors, distances, errors[0], strict=True)
            )
            scans.append(Ranges(time_ns, "uwb", half, ranges))
            if half % 2 == 0:
                strengths = tuple(
                    RssiReading(anchor.id, float(anchor.radio.expected(distance)) + NOISE_STD[1] * float(error))
                    for anchor, distance, error in zip(anchors, distances, errors[1], strict=True)
                )
                scans.append(WifiScan(time_ns, "wifi", half, strengths))
        return scans


def without(measurements: tuple[Measurement, ...], sensor: str) -> tuple[Measurement, ...]:
    """The measurements of all sensors but one."""
    return tuple(measurement for measurement in measurements if measurement.sensor != sensor)


def with_outlier(measurements: tuple[Measurement, ...], index: int, range_m: float) -> tuple[Measurement, ...]:
    """The measurements with the first reading of the ``index``-th scan of ranges replaced."""
    chosen = [measurement for measurement in measurements if isinstance(measurement, Ranges)][index]
    wrong = RangeReading(chosen.readings[0].anchor, range_m)
    damaged = replace(chosen, readings=(wrong, *chosen.readings[1:]))
    return tuple(damaged if measurement is chosen else measurement for measurement in measurements)
