"""Readings that no estimator should see, taken out once for all of them, each with a Fate that states why."""

from __future__ import annotations

import math
from dataclasses import replace

from fusion.fates import fate
from fusion.values import (
    Decision,
    Fate,
    Gyro,
    Motion,
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


def motion_flaw(measurement: Motion) -> Reason | None:
    """The reason why a measurement of motion cannot be used, or None."""
    if isinstance(measurement, Odometry):
        if measurement.from_ns > measurement.time_ns:
            return Reason.BAD_CLOCK
        is_finite = math.isfinite(measurement.distance_m) and math.isfinite(measurement.turn_rad)
    elif isinstance(measurement, Gyro):
        is_finite = math.isfinite(measurement.rate_rad_s)
    elif isinstance(measurement, MotorCommand):
        is_finite = all(map(math.isfinite, measurement.wheel_speeds_m_s))
    else:
        is_finite = True
    return None if is_finite else Reason.NOT_FINITE


def screen_radio(world: World, scan: Radio) -> tuple[Radio | None, tuple[Fate, ...]]:
    """``scan`` without its unusable readings, the others by anchor (None: nothing is left), and the Fates of those."""
    kept: list[RssiReading | RangeReading] = []
    fates: list[Fate] = []
    seen: set[str] = set()
    in_order, last = True, ""
    for reading in scan.readings:
        reason = _refusal(world, reading, seen)
        if reason is None:
            kept.append(reading)
            seen.add(reading.anchor)
            in_order, last = in_order and last <= reading.anchor, reading.anchor
        else:
            fates.append(fate(scan, reading.anchor, Decision.UNUSABLE, reason))
    if in_order and kept and not fates:
        return scan, ()
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
