"""A differential drive that rolls along exact arcs: the motion model of an odometry calibration.

    d = (k_L l + k_R r) / 2        turn = (k_R r - k_L l) / b

Between two encoder messages both sides roll at constant speeds, so the robot's path is an arc of a circle with the
chord d sin(turn / 2) / (turn / 2), in the direction of the arc's middle (Thrun, Burgard & Fox 2005, section 5.4).
Four skid-steered wheels count as two, at an effective track that belongs to the floor and the tyres.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from fusion import Pose
from fusion.arrays import Floats
from fusion.robot import Robot


class WheelScales(NamedTuple):
    """True over measured roll of the left and the right side, and the effective track [m]."""

    left: float
    right: float
    track_m: float

    @classmethod
    def of(cls, robot: Robot) -> WheelScales:
        """Scales of a world's robot: its track is in counted metres, so the scale of distances stretches it."""
        left, right = robot.side_scales
        scale = robot.distance_scale
        return cls(scale * left, scale * right, scale * robot.track_width_m)

    def applied_to(self, robot: Robot) -> Robot:
        """The robot with these numbers in it: `of` turned round. A constant share of every move is no part of them."""
        scale = 0.5 * (self.left + self.right)
        return dataclasses.replace(
            robot,
            distance_scale=scale,
            distance_offset_m=0.0,
            diameter_ratio=self.right / self.left,
            track_width_m=self.track_m / scale,
        )


def turn_rad(scales: WheelScales, left_m: Floats, right_m: Floats) -> Floats:
    """Turn of each step [rad], left positive."""
    return np.asarray((scales.right * right_m - scales.left * left_m) / scales.track_m)


def arc_end(scales: WheelScales, left_m: Floats, right_m: Floats) -> Pose:
    """Where the robot ends that begins at the origin, heading along x, after steps (n,) [m]; heading not wrapped."""
    turns = turn_rad(scales, left_m, right_m)
    chords = 0.5 * (scales.left * left_m + scales.right * right_m) * np.sinc(turns / (2.0 * np.pi))
    ends = np.cumsum(turns)
    middles = ends - 0.5 * turns
    return Pose(float(chords @ np.cos(middles)), float(chords @ np.sin(middles)), float(ends[-1]) if len(ends) else 0.0)
