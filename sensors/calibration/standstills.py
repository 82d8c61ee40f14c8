"""Standstills of the robot, shown by its wheels, and the readings of its gyro in them.

A standstill is no roll of either side. It is left out where the gyro shows that the robot was moved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusion import Gyro, LogError
from fusion.arrays import Floats, Whole
from fusion.values import NANOSECONDS, nanoseconds
from logs.run import Run
from sensors.calibration.wheels import Wheels

LEAST_NS = nanoseconds(1.0)
"""A shorter standstill has too few samples."""
MARGIN_NS = nanoseconds(0.2)
"""Left out at both ends: wheels tick only some time after the robot has begun to move."""
LEAST_SAMPLES = 10
MOVED = 4.0
"""Scatter over the median scatter of all standstills, from which on one was none."""


class Rates(NamedTuple):
    """A run's gyro in time order (n,): time [ns] and raw rate [rad/s]; ``angle`` its integral by the trapezoid rule."""

    time_ns: Whole
    rate: Floats
    angle: Floats

    def turned(self, from_ns: int, until_ns: int) -> float:
        """Raw angle [rad] between two times."""
        begin, end = np.interp([from_ns, until_ns], self.time_ns, self.angle)
        return float(end - begin)

    def covers(self, from_ns: int, until_ns: int) -> bool:
        """Whether it measured from one time to another."""
        return bool(self.time_ns[0] <= from_ns and until_ns <= self.time_ns[-1])


class Standstill(NamedTuple):
    """One stop of run number ``run``: from when to when, the mean raw rate and the scatter about it [rad/s]."""

    run: int
    from_ns: int
    until_ns: int
    samples: int
    bias: float
    scatter: float


def rates(run: Run) -> Rates:
    """Raises `LogError` where a run has no gyro."""
    readings = sorted(
        (m.time_ns, m.rate_rad_s) for m in run.measurements if isinstance(m, Gyro) and math.isfinite(m.rate_rad_s)
    )
    if len(readings) < 2:
        raise LogError(f"{run.path}: holds no gyro; record a run with the gyro on")
    time_ns, first = np.unique(np.array([time for time, _ in readings], dtype=np.int64), return_index=True)
    rate = np.array([rate for _, rate in readings])[first]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_ns) / NANOSECONDS
    return Rates(time_ns, rate, np.concatenate([[0.0], np.cumsum(steps)]))


def standstills(gyro: Rates, wheels: Wheels, number: int) -> list[Standstill]:
    """The stops of one run that are long enough."""
    moving = (np.diff(wheels.left) != 0.0) | (np.diff(wheels.right) != 0.0) | (np.diff(wheels.lost) > 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]]).astype(int)))
    stops = []
    for begin, end in zip(wheels.time_ns[edges[0::2]], wheels.time_ns[edges[1::2]], strict=True):
        inside = (gyro.time_ns >= begin + MARGIN_NS) & (gyro.time_ns <= end - MARGIN_NS)
        if end - begin >= LEAST_NS and inside.sum() >= LEAST_SAMPLES:
            rate = gyro.rate[inside]
            stops.append(
                Standstill(number, int(begin), int(end), len(rate), float(rate.mean()), float(rate.std(ddof=1)))
            )
    return stops


def still(stops: Sequence[Standstill]) -> list[Standstill]:
    """Without those in which the robot was moved: carried, or turned on slipping wheels."""
    usual = float(np.median([each.scatter for each in stops])) if stops else 0.0
    middle = float(np.median([each.bias for each in stops])) if stops else 0.0
    limit = max(MOVED * usual, 1e-9)
    return [each for each in stops if each.scatter <= limit and abs(each.bias - middle) <= limit]


def samples(stop: Standstill, gyros: Sequence[Rates]) -> tuple[Whole, Floats]:
    """Times and raw rates within one standstill, without its margins."""
    own = gyros[stop.run]
    inside = (own.time_ns >= stop.from_ns + MARGIN_NS) & (own.time_ns <= stop.until_ns - MARGIN_NS)
    return own.time_ns[inside], own.rate[inside]
