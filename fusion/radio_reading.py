"""Radio readings for filters: one scalar at a time, with the reading that the world expects."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion.arrays import Floats
from fusion.radio import DistanceModel
from fusion.values import Radio, RssiReading
from fusion.world import Anchor, World


class Expectation(NamedTuple):
    """The reading expected at a pose, and its derivatives [reading's unit / m, / m, / rad, / the model's gain]."""

    value: float
    by_x: float
    by_y: float
    by_heading: float
    by_gain: float


class RadioReading(NamedTuple):
    """One reading of one anchor: value and variance in the reading's unit (dBm and dB^2, or m and m^2)."""

    anchor: Anchor
    model: DistanceModel
    value: float
    variance: float

    def expect(self, x: float, y: float, heading: float, antenna_m: tuple[float, float, float]) -> Expectation:
        """Expected reading with the robot's base at (x, y, heading), its antenna at ``antenna_m`` on it."""
        c, s = math.cos(heading), math.sin(heading)
        arm_x, arm_y = c * antenna_m[0] - s * antenna_m[1], s * antenna_m[0] + c * antenna_m[1]
        dx, dy, dz = x + arm_x - self.anchor.x, y + arm_y - self.anchor.y, antenna_m[2] - self.anchor.z
        distance = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
        value, slope, by_gain = self.model.at(distance)
        slope /= distance
        return Expectation(value, slope * dx, slope * dy, slope * (dy * arm_x - dx * arm_y), by_gain)

    def expected_values(
        self,
        x: Floats,
        y: Floats,
        heading: Floats,
        antenna_m: tuple[float, float, float],
    ) -> Floats:
        """`expect` over many poses at once, without derivatives; all arrays of one shape."""
        c, s = np.cos(heading), np.sin(heading)
        dx = x + c * antenna_m[0] - s * antenna_m[1] - self.anchor.x
        dy = y + s * antenna_m[0] + c * antenna_m[1] - self.anchor.y
        return self.model.expected(np.sqrt(dx * dx + dy * dy + (antenna_m[2] - self.anchor.z) ** 2))


def radio_readings(world: World, scan: Radio) -> tuple[RadioReading, ...]:
    """The readings of a screened scan whose anchors the world has, in their order.

    A range's variance is the larger of the world's and the device's own: devices are optimists.
    """
    readings: list[RadioReading] = []
    for reading in scan.readings:
        anchor = world.anchor(reading.anchor)
        if anchor is None:
            continue
        if isinstance(reading, RssiReading):
            readings.append(RadioReading(anchor, anchor.radio, reading.rssi_dbm, anchor.radio.std**2))
        else:
            std = max(anchor.ranging.std, reading.std_m or 0.0)
            readings.append(RadioReading(anchor, anchor.ranging, reading.range_m, std**2))
    return tuple(readings)
