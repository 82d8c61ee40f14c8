"""Odometry integrated with its uncertainty: the motion half of every estimator.

An `Increment` is the relative motion between two radio epochs, in the frame of its start. It is exact for the
filters built on it: an increment's covariance sees the starting pose only through the heading, so a rotation at the
start factors out, and composing once equals stepping many times (Forster et al. 2017 call this pre-integration; here
in SE(2)). Along with the motion it carries its derivatives by the two calibration errors of the turn, so that a
filter can correct them afterwards. The distance's scale needs none: the displacement is proportional to it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fusion.geometry import Covariance, Pose, wrap_angle
from fusion.values import Odometry, seconds
from fusion.world import OdometryNoise


class StepNoise(NamedTuple):
    """Variances of one step in the robot's frame: forward [m^2], sideways [m^2], turn [rad^2]."""

    forward: float
    side: float
    turn: float


def step_noise(noise: OdometryNoise, odometry: Odometry) -> StepNoise:
    """White noise of one increment: proportional to path, turn and time, so it does not depend on the message rate."""
    duration_s = seconds(odometry.time_ns - odometry.from_ns)
    if not odometry.measured:
        drift = noise.drift_std_per_sqrt_s**2 * duration_s
        return StepNoise(drift, drift, noise.turn_drift_std_per_sqrt_s**2 * duration_s)
    path_m, turn_rad = abs(odometry.distance_m), abs(odometry.turn_rad)
    return StepNoise(
        noise.distance_std_per_sqrt_m**2 * path_m + noise.distance_std_per_sqrt_s**2 * duration_s,
        noise.side_std_per_sqrt_m**2 * path_m,
        noise.turn_std_per_sqrt_rad**2 * turn_rad
        + noise.turn_std_per_sqrt_m**2 * path_m
        + noise.turn_std_per_sqrt_s**2 * duration_s,
    )


class Increment(NamedTuple):
    """Relative motion ``start_from_end`` with the covariance of its noise (start frame) [m, rad].

    ``heading`` is not wrapped. ``*_by_bias`` are derivatives by a turn-rate bias [rad/s] that should be added to every
    turn, ``*_by_scale`` by a relative error of every turn; the heading's own are ``duration_s`` and ``heading``.
    ``path_m`` is the length of the path driven.
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    xx: float = 0.0
    xy: float = 0.0
    xh: float = 0.0
    yy: float = 0.0
    yh: float = 0.0
    hh: float = 0.0
    x_by_bias: float = 0.0
    y_by_bias: float = 0.0
    x_by_scale: float = 0.0
    y_by_scale: float = 0.0
    duration_s: float = 0.0
    path_m: float = 0.0

    def extend(self, odometry: Odometry, noise: OdometryNoise) -> Increment:
        """This motion followed by one odometry step (mid-point rule: Thrun et al. 2005, section 5.4)."""
        distance, turn = odometry.distance_m, odometry.turn_rad
        forward, side, turned = step_noise(noise, odometry)
        duration_s = seconds(odometry.time_ns - odometry.from_ns)
        middle = self.heading + 0.5 * turn
        c, s = math.cos(middle), math.sin(middle)
        dx, dy = distance * c, distance * s
        # F moves the pose's own error, G = [c -s -dy/2; s c dx/2; 0 0 1] brings in (forward, side, turn).
        xh, yh = self.xh - dy * self.hh, self.yh + dx * self.hh
        gx, gy = -0.5 * dy, 0.5 * dx
        bias_lever = self.duration_s + 0.5 * duration_s
        return Increment(
            self.x + dx,
            self.y + dy,
            self.heading + turn,
            self.xx - dy * (self.xh + xh) + c * c * forward + s * s * side + gx * gx * turned,
            self.xy + dx * self.xh - dy * yh + c * s * (forward - side) + gx * gy * turned,
            xh + gx * turned,
            self.yy + dx * (self.yh + yh) + s * s * forward + c * c * side + gy * gy * turned,
            yh + gy * turned,
            self.hh + turned,
            self.x_by_bias - dy * bias_lever,
            self.y_by_bias + dx * bias_lever,
            self.x_by_scale - dy * middle,
            self.y_by_scale + dx * middle,
            self.duration_s + duration_s,
            self.path_m + abs(distance),
        )

    @property
    def pose(self) -> Pose:
        """The motion without its uncertainty."""
        return Pose(self.x, self.y, wrap_angle(self.heading))


def compose(pose: Pose, covariance: Covariance, increment: Increment) -> tuple[Pose, Covariance]:
    """A pose with its covariance (map frame), moved by an increment: P <- A P Aᵀ + B C Bᵀ with
    A = [1 0 -gy; 0 1 gx; 0 0 1] and B = blockdiag(R(heading), 1), where g = R(heading) (x, y).
    """
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    gx, gy = c * increment.x - s * increment.y, s * increment.x + c * increment.y
    xx, xy, xh, yy, yh, hh = covariance
    ixx, ixy, iyy = increment.xx, increment.xy, increment.yy
    moved_xh, moved_yh = xh - gy * hh, yh + gx * hh
    moved = Covariance(
        xx - gy * (xh + moved_xh) + c * c * ixx - 2.0 * c * s * ixy + s * s * iyy,
        xy + gx * xh - gy * moved_yh + c * s * (ixx - iyy) + (c * c - s * s) * ixy,
        moved_xh + c * increment.xh - s * increment.yh,
        yy + gx * (yh + moved_yh) + s * s * ixx + 2.0 * c * s * ixy + c * c * iyy,
        moved_yh + s * increment.xh + c * increment.yh,
        hh + increment.hh,
    )
    return Pose(pose.x + gx, pose.y + gy, wrap_angle(pose.heading + increment.heading)), moved
