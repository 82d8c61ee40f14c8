"""From wheel ticks, motor commands and gyro to odometry increments, once for every estimator.

The front end of the host folds every measurement of motion through `Odometer.advance`, and holds the last twist up to
a radio reading that falls between two odometry messages (`Odometer.hold`). The part held is taken off when the real
increment arrives, so motion counts exactly once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fusion.errors import MeasurementError
from fusion.geometry import wrap_angle
from fusion.robot import WHEELS, Robot
from fusion.values import Gyro, Motion, MotorCommand, Odometry, WheelTicks, nanoseconds, seconds

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


def since(start_ns: int, odometry: Odometry) -> Odometry:
    """The part of an increment from ``start_ns`` on, its twist taken as steady.

    >>> since(60, Odometry(100, "wheels", 0, from_ns=0, distance_m=0.5, turn_rad=1.0)).distance_m
    0.2
    """
    if odometry.from_ns >= start_ns:
        return odometry
    share = (odometry.time_ns - start_ns) / (odometry.time_ns - odometry.from_ns)
    distance_m, turn_rad = share * odometry.distance_m, share * odometry.turn_rad
    return replace(odometry, from_ns=start_ns, distance_m=distance_m, turn_rad=turn_rad)


class _GyroAngle(NamedTuple):
    """The gyro's integral: angle [rad] at a time, and the rate then [rad/s]."""

    time_ns: int
    angle: float
    rate: float

    def at(self, time_ns: int) -> float:
        return self.angle + self.rate * seconds(time_ns - self.time_ns)


class OdometerState(NamedTuple):
    """Memory of the odometer. ``start_ns``: motion before it is none of this run's; ``covered_ns``: motion is
    accounted for up to here.
    """

    start_ns: int
    covered_ns: int
    last_ns: int
    span_ns: int = 0
    speed_m_s: float = 0.0
    turn_rate_rad_s: float = 0.0
    held_distance_m: float = 0.0
    held_turn_rad: float = 0.0
    counts: tuple[int, ...] | None = None
    forward: tuple[int, ...] | None = None
    moving: bool = False
    gyro: _GyroAngle | None = None
    gyro_angle_at_last: float = 0.0


class _Twist(NamedTuple):
    """Mean speed [m/s] and turn rate [rad/s] of an increment, and the time it is a mean over."""

    span_ns: int
    speed_m_s: float
    turn_rate_rad_s: float


def _twist(state: OdometerState, own: Odometry, turn_rad: float) -> _Twist:
    """The twist of an increment: its mean, or over `TWIST_NS` where it is too short to give one."""
    span_ns = own.time_ns - own.from_ns
    if span_ns >= SHORT_NS or state.span_ns == 0:
        span_s = max(seconds(span_ns), 1e-9)
        return _Twist(span_ns, own.distance_m / span_s, turn_rad / span_s)
    before, span_s = 1.0 - span_ns / TWIST_NS, seconds(TWIST_NS)
    speed_m_s = before * state.speed_m_s + own.distance_m / span_s
    return _Twist(TWIST_NS, speed_m_s, before * state.turn_rate_rad_s + turn_rad / span_s)


def _forward(before: tuple[int, ...] | None, speeds_m_s: Sequence[float]) -> tuple[int, ...]:
    """1 for each wheel that turns forwards, -1 backwards; one that is to stand rolls out the way it turned before."""
    known = before or (1,) * len(speeds_m_s)
    return tuple(
        then if speed == 0.0 else 1 if speed > 0.0 else -1 for then, speed in zip(known, speeds_m_s, strict=True)
    )


class Odometer:
    """Turns one robot's motion measurements into `Odometry`. Holds the robot only; the state is a value."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._distance = LinearDistance(robot.distance_scale, robot.distance_offset_m)

    def start(self, time_ns: int) -> OdometerState:
        """Motion is accounted for from ``time_ns`` on; no increment that ends by then may be handed to `advance`."""
        return OdometerState(start_ns=time_ns, covered_ns=time_ns, last_ns=time_ns)

    def advance(self, state: OdometerState, measurement: Motion) -> tuple[OdometerState, tuple[Odometry, ...]]:
        """The state after a measurement of motion, and the increments that it brought, in order.

        Raises `MeasurementError` when it is of more or fewer wheels than the robot has.
        """
        if isinstance(measurement, Odometry):
            return self._real(state, measurement)
        if isinstance(measurement, WheelTicks):
            return self._ticks(state, measurement)
        if isinstance(measurement, Gyro):
            return self._gyro(state, measurement), ()
        self._require_wheels(len(measurement.wheel_speeds_m_s), measurement)
        return state._replace(forward=_forward(state.forward, measurement.wheel_speeds_m_s)), ()

    def _require_wheels(self, count: int, measurement: WheelTicks | MotorCommand) -> None:
        wheels = len(WHEELS[self.robot.drive])
        if count != wheels:
            raise MeasurementError(
                f"{type(measurement).__name__} of {measurement.sensor!r} at {measurement.time_ns} ns has {count} "
                f"wheels, the world's {self.robot.drive} drive has {wheels}; correct robot.drive, or the driver"
            )

    def hold(self, state: OdometerState, time_ns: int) -> tuple[OdometerState, tuple[Odometry, ...]]:
        """Motion up to ``time_ns`` on the last twist known; past the longest hold, unmeasured motion."""
        if time_ns <= state.covered_ns:
            return state, ()
        limit_ns = state.last_ns + max(MAX_HOLD_NS, state.span_ns * 3 // 2) if state.span_ns else state.covered_ns
        motion: list[Odometry] = []
        for until_ns, measured in ((min(time_ns, limit_ns), True), (time_ns, False)):
            if until_ns > state.covered_ns:
                duration_s = seconds(until_ns - state.covered_ns) if measured else 0.0
                distance, turn = state.speed_m_s * duration_s, state.turn_rate_rad_s * duration_s
                motion.append(Odometry(until_ns, "held", 0, state.covered_ns, distance, turn, measured))
                state = state._replace(
                    covered_ns=until_ns,
                    held_distance_m=state.held_distance_m + distance,
                    held_turn_rad=state.held_turn_rad + turn,
                )
        return state, tuple(motion)

    def _real(self, state: OdometerState, odometry: Odometry) -> tuple[OdometerState, tuple[Odometry, ...]]:
        """A measured increment: what was driven before the start, or held already, is taken off."""
        own = since(state.start_ns, odometry)
        turn = own.turn_rad
        angle = state.gyro_angle_at_last
        if self.robot.turn_source == "gyro" and state.gyro is not None:
            angle = state.gyro.at(odometry.time_ns)
            if odometry.time_ns - state.gyro.time_ns <= MAX_GYRO_AGE_NS:
                turn = angle - state.gyro_angle_at_last
        remaining = Odometry(
            odometry.time_ns,
            odometry.sensor,
            odometry.seq,
            min(state.covered_ns, odometry.time_ns),
            own.distance_m - state.held_distance_m,
            turn - state.held_turn_rad,
            odometry.measured,
        )
        twist = _twist(state, own, turn)
        return state._replace(
            covered_ns=max(state.covered_ns, odometry.time_ns),
            last_ns=odometry.time_ns,
            span_ns=max(twist.span_ns, odometry.time_ns - odometry.from_ns),
            speed_m_s=twist.speed_m_s,
            turn_rate_rad_s=twist.turn_rate_rad_s,
            held_distance_m=0.0,
            held_turn_rad=0.0,
            gyro_angle_at_last=angle,
        ), (remaining,)

    def _ticks(self, state: OdometerState, ticks: WheelTicks) -> tuple[OdometerState, tuple[Odometry, ...]]:
        self._require_wheels(len(ticks.counts), ticks)
        before, counted = state.counts, state._replace(counts=ticks.counts)
        if before is None:
            angle = state.gyro.at(ticks.time_ns) if state.gyro else 0.0
            return counted._replace(last_ns=ticks.time_ns, gyro_angle_at_last=angle), ()
        signs = state.forward if self.robot.encoder == "single_channel" and state.forward else (1,) * len(before)
        per_tick = self.robot.distance_per_tick_m
        rolled = [sign * per_tick * (now - then) for sign, now, then in zip(signs, ticks.counts, before, strict=True)]
        span_ns = ticks.time_ns - state.last_ns
        if max(map(abs, rolled)) > MAX_WHEEL_SPEED_M_S * max(seconds(span_ns), 0.1):
            return counted, ()
        distance, turn = wheel_increment(self.robot, rolled)
        distance = self._distance.true_step(distance, moving=state.moving)
        counted = counted._replace(moving=bool(distance))
        return self._real(
            counted, Odometry(ticks.time_ns, ticks.sensor, ticks.seq, state.last_ns, distance, wrap_angle(turn))
        )

    def _gyro(self, state: OdometerState, gyro: Gyro) -> OdometerState:
        if self.robot.turn_source != "gyro":
            return state
        rate, before = self.robot.gyro_scale * (gyro.rate_rad_s - self.robot.gyro_bias_rad_s), state.gyro
        if before is None:
            first = _GyroAngle(gyro.time_ns, 0.0, rate)
            return state._replace(gyro=first, gyro_angle_at_last=first.at(state.last_ns))
        mean_rate = 0.5 * (before.rate + rate)
        angle = before.angle + mean_rate * seconds(gyro.time_ns - before.time_ns)
        return state._replace(gyro=_GyroAngle(gyro.time_ns, angle, rate))
