"""Odometry integrated with its uncertainty: the motion half of every estimator.

An `Increment` is the relative motion between two radio epochs, in the frame of its start. It is exact for the
filters built on it: an increment's covariance sees the starting pose only through the heading, so a rotation at the
start factors out, and composing once equals stepping many times (Forster et al. 2017 call this pre-integration; here
in SE(2)). Along with the motion it carries its derivatives by the two calibration errors of the turn, so that a
filter can correct them afterwards. The distance's scale needs none: the displacement is proportional to it.

The host integrates motion once per run, for every estimator. What an estimator does with it is `compose` where it
keeps no calibration errors, and `move` where it does.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

from fusion.arrays import Floats
from fusion.geometry import Covariance, Pose, wrap_angle
from fusion.robot import OdometryNoise
from fusion.values import NANOSECONDS, Odometry

Number = TypeVar("Number", float, Floats)
NO_NOISE = Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Increment(NamedTuple):
    """Relative motion ``start_from_end`` [m, rad] up to ``time_ns``; ``covariance`` of its noise (start frame).

    ``heading`` is not wrapped. ``*_by_bias`` are derivatives by a turn-rate bias [rad/s] that should be added to every
    turn, ``*_by_scale`` by a relative error of every turn; the heading's own are ``duration_s`` and ``heading``.
    ``path_m`` is the length of the path driven, ``unmeasured_s`` the part of ``duration_s`` in which nothing measured
    the motion.
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    covariance: Covariance = NO_NOISE
    x_by_bias: float = 0.0
    y_by_bias: float = 0.0
    x_by_scale: float = 0.0
    y_by_scale: float = 0.0
    duration_s: float = 0.0
    path_m: float = 0.0
    unmeasured_s: float = 0.0
    time_ns: int = 0

    def extend(self, odometry: Odometry, noise: OdometryNoise) -> Increment:
        """This motion followed by one odometry step."""
        integral = Integral(noise, self)
        integral.extend(odometry.from_ns, odometry.time_ns, odometry.distance_m, odometry.turn_rad, odometry.measured)
        return integral.increment

    def then(self, later: Increment) -> Increment:
        """This motion followed by a ``later`` one that starts where it ends."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        (x, y, _), covariance = compose(Pose(self.x, self.y, self.heading), self.covariance, later)
        dx, dy = x - self.x, y - self.y
        return Increment(
            x,
            y,
            self.heading + later.heading,
            covariance,
            self.x_by_bias + c * later.x_by_bias - s * later.y_by_bias - dy * self.duration_s,
            self.y_by_bias + s * later.x_by_bias + c * later.y_by_bias + dx * self.duration_s,
            self.x_by_scale + c * later.x_by_scale - s * later.y_by_scale - dy * self.heading,
            self.y_by_scale + s * later.x_by_scale + c * later.y_by_scale + dx * self.heading,
            self.duration_s + later.duration_s,
            self.path_m + later.path_m,
            self.unmeasured_s + later.unmeasured_s,
            later.time_ns,
        )

    def corrected(self, distance_error: Number, turn_error: Number, turn_bias: Number) -> tuple[Number, Number, Number]:
        """Displacement forward and left [m], and turn [rad], by the calibration errors of the odometry, to first order
        in those of the turn: relative errors of distance and turn, and turn-rate bias [rad/s]; floats, or arrays.
        """
        stretch = 1.0 + distance_error
        return (
            stretch * (self.x + self.x_by_scale * turn_error + self.x_by_bias * turn_bias),
            stretch * (self.y + self.y_by_scale * turn_error + self.y_by_bias * turn_bias),
            self.heading * (1.0 + turn_error) + self.duration_s * turn_bias,
        )

    @property
    def pose(self) -> Pose:
        """The motion without its uncertainty."""
        return Pose(self.x, self.y, wrap_angle(self.heading))


class Integral:
    """The running integral of odometry steps: an `Increment` in the making. It changes at the rate of the odometry, so
    it is one object that is written to.
    """

    __slots__ = (*Increment._fields, *(f"_{name}" for name in Covariance._fields), "_drift_rates", "_rates")

    def __init__(self, noise: OdometryNoise, begun: Increment) -> None:
        # White noise of the odometry as variances per metre, radian and second: it does not depend on the message rate.
        self._rates = (
            noise.distance_std_per_sqrt_m**2,
            noise.distance_std_per_sqrt_s**2,
            noise.side_std_per_sqrt_m**2,
            noise.turn_std_per_sqrt_rad**2,
            noise.turn_std_per_sqrt_m**2,
            noise.turn_std_per_sqrt_s**2,
        )
        self._drift_rates = noise.drift_std_per_sqrt_s**2, noise.turn_drift_std_per_sqrt_s**2
        self.restart(begun)

    def restart(self, begun: Increment) -> None:
        """Go on from ``begun``."""
        (
            self.x,
            self.y,
            self.heading,
            (self._xx, self._xy, self._xh, self._yy, self._yh, self._hh),
            self.x_by_bias,
            self.y_by_bias,
            self.x_by_scale,
            self.y_by_scale,
            self.duration_s,
            self.path_m,
            self.unmeasured_s,
            self.time_ns,
        ) = begun

    def copy(self) -> Integral:
        """Another one in the same state."""
        twin = object.__new__(Integral)
        twin._rates, twin._drift_rates = self._rates, self._drift_rates
        twin.restart(self.increment)
        return twin

    @property
    def increment(self) -> Increment:
        """The motion up to now."""
        return Increment(
            self.x,
            self.y,
            self.heading,
            Covariance(self._xx, self._xy, self._xh, self._yy, self._yh, self._hh),
            self.x_by_bias,
            self.y_by_bias,
            self.x_by_scale,
            self.y_by_scale,
            self.duration_s,
            self.path_m,
            self.unmeasured_s,
            self.time_ns,
        )

    def extend(self, from_ns: int, time_ns: int, distance_m: float, turn_rad: float, measured: bool) -> None:
        """One step of odometry more, as `fusion.odometry.Step` (mid-point rule: Thrun et al. 2005, section 5.4)."""
        duration_s = (time_ns - from_ns) / NANOSECONDS
        path_m = abs(distance_m)
        if measured:
            per_m, per_s, side_per_m, turn_per_rad, turn_per_m, turn_per_s = self._rates
            forward, side = per_m * path_m + per_s * duration_s, side_per_m * path_m
            turned = turn_per_rad * abs(turn_rad) + turn_per_m * path_m + turn_per_s * duration_s
        else:
            forward = side = self._drift_rates[0] * duration_s
            turned = self._drift_rates[1] * duration_s
            self.unmeasured_s += duration_s
        middle = self.heading + 0.5 * turn_rad
        c, s = math.cos(middle), math.sin(middle)
        dx, dy = distance_m * c, distance_m * s
        # F moves the pose's own error, G = [c -s -dy/2; s c dx/2; 0 0 1] brings in (forward, side, turn).
        own_xh, own_yh, hh = self._xh, self._yh, self._hh
        xh, yh = own_xh - dy * hh, own_yh + dx * hh
        gx, gy = -0.5 * dy, 0.5 * dx
        self._xx = self._xx - dy * (own_xh + xh) + c * c * forward + s * s * side + gx * gx * turned
        self._xy = self._xy + dx * own_xh - dy * yh + c * s * (forward - side) + gx * gy * turned
        self._xh = xh + gx * turned
        self._yy = self._yy + dx * (own_yh + yh) + s * s * forward + c * c * side + gy * gy * turned
        self._yh = yh + gy * turned
        self._hh = hh + turned
        bias_lever = self.duration_s + 0.5 * duration_s
        self.x += dx
        self.y += dy
        self.heading += turn_rad
        self.x_by_bias -= dy * bias_lever
        self.y_by_bias += dx * bias_lever
        self.x_by_scale -= dy * middle
        self.y_by_scale += dx * middle
        self.duration_s += duration_s
        self.path_m += path_m
        self.time_ns = time_ns


class Move(NamedTuple):
    """A pose moved by an increment: displacement ``dx``, ``dy`` [m] in the map frame and ``turn`` [rad]; the rows of
    its Jacobian by (distance error, turn error, turn bias); its ``noise`` in the map frame. By the heading, the
    position changes by (-dy, dx).
    """

    dx: float
    dy: float
    turn: float
    x_by_errors: tuple[float, float, float]
    y_by_errors: tuple[float, float, float]
    turn_by_errors: tuple[float, float, float]
    noise: Covariance


def move(
    heading: float, motion: Increment, distance_error: float = 0.0, turn_error: float = 0.0, turn_bias: float = 0.0
) -> Move:
    """The move of a pose of that ``heading`` by ``motion``, the odometry's calibration errors as given."""
    forward, left, turn = motion.corrected(distance_error, turn_error, turn_bias)
    c, s = math.cos(heading), math.sin(heading)
    stretch = 1.0 + distance_error
    dx, dy = c * forward - s * left, s * forward + c * left
    return Move(
        dx,
        dy,
        turn,
        (
            dx / stretch,
            stretch * (c * motion.x_by_scale - s * motion.y_by_scale),
            stretch * (c * motion.x_by_bias - s * motion.y_by_bias),
        ),
        (
            dy / stretch,
            stretch * (s * motion.x_by_scale + c * motion.y_by_scale),
            stretch * (s * motion.x_by_bias + c * motion.y_by_bias),
        ),
        (0.0, motion.heading, motion.duration_s),
        rotated(motion.covariance, c, s),
    )


def rotated(covariance: Covariance, c: float, s: float) -> Covariance:
    """R C Rᵀ, R the rotation of the position by the angle with cosine ``c`` and sine ``s``."""
    xx, xy, xh, yy, yh, hh = covariance
    return Covariance(
        c * c * xx - 2.0 * c * s * xy + s * s * yy,
        c * s * (xx - yy) + (c * c - s * s) * xy,
        c * xh - s * yh,
        s * s * xx + 2.0 * c * s * xy + c * c * yy,
        s * xh + c * yh,
        hh,
    )


def compose(pose: Pose, covariance: Covariance, increment: Increment) -> tuple[Pose, Covariance]:
    """A pose with its covariance (map frame), moved by an increment: P <- A P Aᵀ + B C Bᵀ with
    A = [1 0 -gy; 0 1 gx; 0 0 1] and B = blockdiag(R(heading), 1), where g = R(heading) (x, y).
    """
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    gx, gy = c * increment.x - s * increment.y, s * increment.x + c * increment.y
    xx, xy, xh, yy, yh, hh = covariance
    noise = rotated(increment.covariance, c, s)
    moved_xh, moved_yh = xh - gy * hh, yh + gx * hh
    moved = Covariance(
        xx - gy * (xh + moved_xh) + noise.xx,
        xy + gx * xh - gy * moved_yh + noise.xy,
        moved_xh + noise.xh,
        yy + gx * (yh + moved_yh) + noise.yy,
        moved_yh + noise.yh,
        hh + noise.hh,
    )
    return Pose(pose.x + gx, pose.y + gy, wrap_angle(pose.heading + increment.heading)), moved
