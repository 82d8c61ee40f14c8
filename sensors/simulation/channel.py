"""One anchor's radio as it really is: its own power, its own shadowing field, walls in the way."""

from __future__ import annotations

import itertools
import math

import numpy as np

from fusion import Anchor, Pose
from sensors.simulation.scenario import Scenario

WAVES = 48
"""Cosine waves that make up one anchor's shadowing field (spectral representation of a Gaussian field)."""

Point = tuple[float, float]


class Channel:
    """Between one anchor and the robot; what stays the same for a whole run is drawn from ``stream``."""

    def __init__(self, anchor: Anchor, stream: np.random.Generator, scenario: Scenario) -> None:
        self._anchor, self._scenario = anchor, scenario
        reality = scenario.reality
        self._offset_db = stream.normal(0.0, reality.anchor_offset_std_db)
        self._waves = stream.normal(0.0, 1.0 / reality.shadowing_length_m, (WAVES, 2))
        self._phases = stream.uniform(0.0, math.tau, WAVES)

    def rssi_dbm(self, pose: Pose, stream: np.random.Generator, count: int = 1) -> float:
        """The mean of ``count`` readings, each in whole dBm as receivers give them."""
        reality, (x, y, distance) = self._scenario.reality, self._antenna(pose)
        field = math.sqrt(2.0 / WAVES) * np.cos(self._waves @ (x, y) + self._phases).sum()
        shadowing_db = reality.shadowing_std_db * field + stream.normal(0.0, reality.fading_std_db, count)
        loss_db = reality.wall_loss_db * self._walls(x, y)
        received = float(self._anchor.radio.expected(distance)) + self._offset_db + shadowing_db - loss_db
        return float(np.mean(np.round(received)))

    def range_m(self, pose: Pose, stream: np.random.Generator) -> float:
        """One range; through walls it reads too long."""
        reality, (x, y, distance) = self._scenario.reality, self._antenna(pose)
        noise, excess = stream.normal(0.0, reality.range_std_m), stream.exponential(reality.wall_excess_m)
        return float(self._anchor.ranging.expected(distance)) + noise + excess * min(self._walls(x, y), 3)

    def _antenna(self, pose: Pose) -> tuple[float, float, float]:
        """The robot's antenna on the floor plan [m], and its distance to the anchor [m]."""
        forward, left, up = self._scenario.world.robot.antenna_m
        x, y = pose.transform(forward, left)
        return x, y, math.dist((x, y, up), (self._anchor.x, self._anchor.y, self._anchor.z))

    def _walls(self, x: float, y: float) -> int:
        """Walls between the anchor and a place."""
        here, there = (x, y), (self._anchor.x, self._anchor.y)
        walls = self._scenario.world.walls
        return sum(_cross(here, there, a, b) for wall in walls for a, b in itertools.pairwise(wall))


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether the segments a-b and c-d cross."""

    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) < 0.0 and side(c, d, a) * side(c, d, b) < 0.0
