"""Readings that no estimator should see, taken out once for all of them, each with a Fate that states why."""

from __future__ import annotations

import math
from dataclasses import replace

from fusion.fates import fate, unusable
from fusion.values import (
    Decision,
    Fate,
    Gyro,
    Measurement,
    MotorCommand,
    Odometry,
    Radio,
    RangeReading,
    Reason,
    RssiReading,
    nanoseconds,
)
from fusion.world import World

MAX_READING_AGE_NS = nanoseconds(3.0)
"""Oldest reading of a scan still taken: a radio may list an anchor long after it last received it."""
RSSI_RANGE_DBM = (-120.0, 20.0)
"""Signal strengths a receiver can report; others are codes for "nothing received", such as 0 x 256 or 127."""


def screen(world: World, measurement: Measurement) -> tuple[Measurement | None, tuple[Fate, ...]]:
    """``measurement`` without its unusable readings (None: nothing is left), and the Fates of those."""
    if isinstance(measurement, Radio):
        return _screen_radio(world, measurement)
    if isinstance(measurement, Odometry):
        if measurement.from_ns > measurement.time_ns:
            return None, unusable(measurement, Reason.BAD_CLOCK)
        numbers: tuple[float, ...] = (measurement.distance_m, measurement.turn_rad)
    elif isinstance(measurement, Gyro):
        numbers = (measurement.rate_rad_s,)
    elif isinstance(measurement, MotorCommand):
        numbers = measurement.wheel_speeds_m_s
    else:
        numbers = ()
    if not all(map(math.isfinite, numbers)):
        return None, unusable(measurement, Reason.NOT_FINITE)
    return measurement, ()


def _screen_radio(world: World, scan: Radio) -> tuple[Measurement | None, tuple[Fate, ...]]:
    kept: list[RssiReading | RangeReading] = []
    fates: list[Fate] = []
    seen: set[str] = set()
    for reading in scan.readings:
        reason = _refusal(world, reading, seen)
        if reason is None:
            kept.append(reading)
            seen.add(reading.anchor)
        else:
            fates.append(fate(scan, reading.anchor, Decision.UNUSABLE, reason))
    kept.sort(key=lambda reading: reading.anchor)
    return (replace(scan, readings=tuple(kept)) if kept else None), tuple(fates)  # type: ignore[arg-type]


def _refusal(world: World, reading: RssiReading | RangeReading, seen: set[str]) -> Reason | None:
    if world.anchor(reading.anchor) is None:
        return Reason.UNKNOWN_ANCHOR
    if reading.anchor in seen:
        return Reason.DUPLICATE
    if isinstance(reading, RssiReading):
        if not math.isfinite(reading.rssi_dbm):
            return Reason.NOT_FINITE
        if not RSSI_RANGE_DBM[0] <= reading.rssi_dbm <= RSSI_RANGE_DBM[1]:
            return Reason.OUT_OF_RANGE
        return Reason.STALE if reading.age_ns > MAX_READING_AGE_NS else None
    if not math.isfinite(reading.range_m) or not math.isfinite(reading.std_m or 0.0):
        return Reason.NOT_FINITE
    return Reason.OUT_OF_RANGE if reading.range_m <= 0.0 else None
