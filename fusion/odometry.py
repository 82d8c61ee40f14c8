"""From wheel ticks, motor commands and gyro to odometry increments, once for every estimator.

The front end of the host folds every measurement of motion through `Odometer.advance`, and holds the last twist up to
a radio reading that falls between two odometry messages (`Odometer.hold`). The part held is taken off when the real
increment arrives, so motion counts exactly once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from fusion.errors import MeasurementError
from fusion.geometry import wrap_angle
from fusion.robot import WHEELS, Robot
from fusion.values import NANOSECONDS, Gyro, Motion, MotorCommand, Odometry, WheelTicks, nanoseconds, seconds

MAX_HOLD_NS = nanoseconds(0.5)
"""Longest time a twist is held without new odometry, unless odometry itself comes more slowly."""
SHORT_NS = nanoseconds(0.005)
"""Stamps closer than this are those of a late message and its successor: the motion between them took longer."""
TWIST_NS = nanoseconds(0.05)
"""The twist of an increment that short is the mean over this time, what came before taken as steady."""
MAX_GYRO_AGE_NS = nanoseconds(0.2)
"""Oldest gyro sample that still gives the turn; beyond it the wheels do."""
MAX_WHEEL_SPEED_M_S = 10.0
"""Faster than this between two messages, the encoder counter was reset: the increment is dropped."""


class LinearDistance(NamedTuple):
    """True distance as a straight line over the measured one: the paper's odometry model (section II-B, Fig. 3)."""

    scale: float = 1.0
    offset_m: float = 0.0

    @classmethod
    def fit(cls, measured_m: Sequence[float], true_m: Sequence[float]) -> LinearDistance:
        """Least squares over whole moves [m].

        >>> LinearDistance.fit([1.0, 2.0, 3.0], [1.15, 2.25, 3.35])._asdict()
        {'scale': 1.1, 'offset_m': 0.05}
        """
        scale, offset_m = np.polyfit(measured_m, true_m, 1)
        return cls(round(float(scale), 12), round(float(offset_m), 12))

    def true_distance(self, measured_m: float) -> float:
        """True length [m] of one whole move, its sign kept; no move stays no move."""
        if measured_m == 0.0:
            return 0.0
        return self.scale * measured_m + (self.offset_m if measured_m > 0.0 else -self.offset_m)

    def true_step(self, measured_m: float, *, moving: bool) -> float:
        """True length [m] of one step of a move: the offset counts once, where the move begins (``moving`` False)."""
        return self.scale * measured_m if moving else self.true_distance(measured_m)


def wheel_increment(robot: Robot, rolled_m: Sequence[float]) -> tuple[float, float]:
    """Path length [m] and turn [rad] from the distance each wheel rolled [m], in the wheel order of `World`.

    Both sides are averaged; four skid-steered wheels act as two at the effective track width
    (Borenstein et al. 1997, section 1.2).
    """
    left_scale, right_scale = robot.side_scales
    left = left_scale * sum(rolled_m[0::2]) / len(rolled_m[0::2])
    right = right_scale * sum(rolled_m[1::2]) / len(rolled_m[1::2])
    return 0.5 * (left + right), (right - left) / robot.track_width_m


class _GyroAngle(NamedTuple):
    """The gyro's integral: angle [rad] at a time, and the rate then [rad/s]."""

    time_ns: int
    angle: float
    rate: float

    def at(self, time_ns: int) -> float:
        return self.angle + self.rate * seconds(time_ns - self.time_ns)


class Step(Protocol):
    """Takes one step of motion over (``from_ns``, ``time_ns``]: path length [m] and turn [rad]."""

    def __call__(self, from_ns: int, time_ns: int, distance_m: float, turn_rad: float, measured: bool) -> None:
        """``measured`` False: nothing measured the motion of that time, and zero stands for "not known"."""


def _forward(before: tuple[int, ...] | None, speeds_m_s: Sequence[float]) -> tuple[int, ...]:
    """1 for each wheel that turns forwards, -1 backwards; one that is to stand rolls out the way it turned before."""
    known = before or (1,) * len(speeds_m_s)
    return tuple(
        then if speed == 0.0 else 1 if speed > 0.0 else -1 for then, speed in zip(known, speeds_m_s, strict=True)
    )


class Odometer:
    """Turns one robot's motion measurements into steps of motion. ``start_ns``: motion before it is none of this run's,
    and no increment that ends by then may be handed to `advance`. It changes at the rate of the wheels, so it is one
    object that is written to.
    """

    __slots__ = (
        "_counts",
        "_covered_ns",
        "_distance",
        "_forward",
        "_gyro",
        "_gyro_angle_at_last",
        "_held_distance_m",
        "_held_turn_rad",
        "_last_ns",
        "_moving",
        "_span_ns",
        "_speed_m_s",
        "_start_ns",
        "_takes_gyro",
        "_turn_rate_rad_s",
        "robot",
    )

    def __init__(self, robot: Robot, start_ns: int) -> None:
        self.robot = robot
        self._takes_gyro = robot.turn_source == "gyro"
        self._distance = LinearDistance(robot.distance_scale, robot.distance_offset_m)
        self._start_ns = self._covered_ns = self._last_ns = start_ns  # motion is accounted for up to ``covered``
        self._span_ns = 0
        self._speed_m_s = self._turn_rate_rad_s = 0.0
        self._held_distance_m = self._held_turn_rad = 0.0
        self._counts: tuple[int, ...] | None = None
        self._forward: tuple[int, ...] | None = None
        self._moving = False
        self._gyro: _GyroAngle | None = None
        self._gyro_angle_at_last = 0.0

    def copy(self) -> Odometer:
        """Another one in the same state."""
        twin = object.__new__(Odometer)
        for name in Odometer.__slots__:
            setattr(twin, name, getattr(self, name))
        return twin

    def advance(self, measurement: Motion, step: Step) -> None:
        """Hand the motion that a measurement brought to ``step``.

        Raises `MeasurementError` when it is of more or fewer wheels than the robot has.
        """
        if isinstance(measurement, Odometry):
            self._drive(
                measurement.from_ns,
                measurement.time_ns,
                measurement.distance_m,
                measurement.turn_rad,
                measurement.measured,
                step,
            )
        elif isinstance(measurement, WheelTicks):
            self._count(measurement, step)
        elif isinstance(measurement, Gyro):
            self._integrate(measurement)
        else:
            self._require_wheels(len(measurement.wheel_speeds_m_s), measurement)
            self._forward = _forward(self._forward, measurement.wheel_speeds_m_s)

    def _require_wheels(self, count: int, measurement: WheelTicks | MotorCommand) -> None:
        wheels = len(WHEELS[self.robot.drive])
        if count != wheels:
            raise MeasurementError(
                f"{type(measurement).__name__} of {measurement.sensor!r} at {measurement.time_ns} ns has {count} "
                f"wheels, the world's {self.robot.drive} drive has {wheels}; correct robot.drive, or the driver"
            )

    def hold(self, time_ns: int, step: Step) -> None:
        """Hand motion up to ``time_ns`` to ``step``: by the last twist, and past the longest hold as unmeasured."""
        if time_ns <= self._covered_ns:
            return
        limit_ns = self._last_ns + max(MAX_HOLD_NS, self._span_ns * 3 // 2) if self._span_ns else self._covered_ns
        for until_ns, measured in ((min(time_ns, limit_ns), True), (time_ns, False)):
            if until_ns > self._covered_ns:
                duration_s = seconds(until_ns - self._covered_ns) if measured else 0.0
                distance, turn = self._speed_m_s * duration_s, self._turn_rate_rad_s * duration_s
                step(self._covered_ns, until_ns, distance, turn, measured)
                self._covered_ns = until_ns
                self._held_distance_m += distance
                self._held_turn_rad += turn

    def _drive(
        self, from_ns: int, time_ns: int, distance_m: float, turn_rad: float, measured: bool, step: Step
    ) -> None:
        """A measured increment: what was driven before the start, or held already, is taken off."""
        span_ns = time_ns - from_ns
        if from_ns < self._start_ns:  # its twist is taken as steady
            share = (time_ns - self._start_ns) / span_ns
            distance_m, turn_rad = share * distance_m, share * turn_rad
            from_ns = self._start_ns
        if self._takes_gyro and self._gyro is not None:
            angle = self._gyro.at(time_ns)
            if time_ns - self._gyro.time_ns <= MAX_GYRO_AGE_NS:
                turn_rad = angle - self._gyro_angle_at_last
            self._gyro_angle_at_last = angle
        self._twist(time_ns - from_ns, distance_m, turn_rad)
        self._span_ns = max(self._span_ns, span_ns)
        begun_ns, held_m, held_rad = self._covered_ns, self._held_distance_m, self._held_turn_rad
        self._held_distance_m = self._held_turn_rad = 0.0
        self._last_ns = time_ns
        if begun_ns < time_ns:
            self._covered_ns = time_ns
        else:
            begun_ns = time_ns
        step(begun_ns, time_ns, distance_m - held_m, turn_rad - held_rad, measured)

    def _twist(self, span_ns: int, distance_m: float, turn_rad: float) -> None:
        """Mean speed and turn rate of an increment, or over `TWIST_NS` where it is too short to give them."""
        if span_ns >= SHORT_NS or self._span_ns == 0:
            self._span_ns, span_s = span_ns, (span_ns or 1) / NANOSECONDS
            self._speed_m_s, self._turn_rate_rad_s = distance_m / span_s, turn_rad / span_s
            return
        before, span_s = 1.0 - span_ns / TWIST_NS, seconds(TWIST_NS)
        self._span_ns = TWIST_NS
        self._speed_m_s = before * self._speed_m_s + distance_m / span_s
        self._turn_rate_rad_s = before * self._turn_rate_rad_s + turn_rad / span_s

    def _count(self, ticks: WheelTicks, step: Step) -> None:
        self._require_wheels(len(ticks.counts), ticks)
        before, self._counts = self._counts, ticks.counts
        if before is None:
            self._last_ns = ticks.time_ns
            self._gyro_angle_at_last = self._gyro.at(ticks.time_ns) if self._gyro else 0.0
            return
        signs = self._forward if self.robot.encoder == "single_channel" and self._forward else (1,) * len(before)
        per_tick = self.robot.distance_per_tick_m
        rolled = [sign * per_tick * (now - then) for sign, now, then in zip(signs, ticks.counts, before, strict=True)]
        span_ns = ticks.time_ns - self._last_ns
        if max(map(abs, rolled)) > MAX_WHEEL_SPEED_M_S * max(seconds(span_ns), 0.1):
            return
        distance, turn = wheel_increment(self.robot, rolled)
        distance = self._distance.true_step(distance, moving=self._moving)
        self._moving = bool(distance)
        self._drive(self._last_ns, ticks.time_ns, distance, wrap_angle(turn), True, step)

    def _integrate(self, gyro: Gyro) -> None:
        if not self._takes_gyro:
            return
        rate, before = self.robot.gyro_scale * (gyro.rate_rad_s - self.robot.gyro_bias_rad_s), self._gyro
        if before is None:
            self._gyro = _GyroAngle(gyro.time_ns, 0.0, rate)
            self._gyro_angle_at_last = self._gyro.at(self._last_ns)
            return
        mean_rate = 0.5 * (before.rate + rate)
        angle = before.angle + mean_rate * seconds(gyro.time_ns - before.time_ns)
        self._gyro = _GyroAngle(gyro.time_ns, angle, rate)
