"""The robot of a world: its drive, wheels, encoders, gyro and antenna, and the noise of its odometry."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from fusion.errors import WorldError
from fusion.schema import read_record, require_positive

WHEELS: dict[str, tuple[str, ...]] = {
    "differential": ("left", "right"),
    "skid_steer": ("front_left", "front_right", "rear_left", "rear_right"),
    "none": (),
}
"""Kinds of drive and the names of their wheels, in the order of counts and speeds."""
ENCODERS = ("quadrature", "single_channel")
TURN_SOURCES = ("wheels", "gyro")
POSITIVE = (
    "ticks_per_revolution",
    "wheel_circumference_m",
    "track_width_m",
    "distance_scale",
    "diameter_ratio",
    "gyro_scale",
)


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Errors of odometry: white noise whose variance grows with path, turn and time, whatever the message rate
    (after Thrun, Burgard & Fox 2005, table 5.6), and the calibration errors that stay the same for a whole run.
    """

    distance_std_per_sqrt_m: float = 0.02
    distance_std_per_sqrt_s: float = 0.002
    side_std_per_sqrt_m: float = 0.01
    turn_std_per_sqrt_rad: float = 0.03
    turn_std_per_sqrt_m: float = 0.01
    turn_std_per_sqrt_s: float = 0.005
    distance_scale_std: float = 0.02
    turn_scale_std: float = 0.02
    turn_bias_std_rad_s: float = 0.002
    drift_std_per_sqrt_s: float = 0.5
    """Position noise [m/sqrt(s)] while nothing measures the motion: no odometry, or odometry that fell silent."""
    turn_drift_std_per_sqrt_s: float = 0.5
    """The same for the heading [rad/sqrt(s)]."""


@dataclass(frozen=True, slots=True)
class Robot:
    """Wheels, encoders, gyro and antenna of the robot. The defaults are those of the paper's robot: four wheels,
    20 ticks a revolution, 1.02 cm a tick (Moro & Mehrpouyan 2019, section II).
    """

    drive: str = "skid_steer"
    encoder: str = "quadrature"
    ticks_per_revolution: int = 20
    wheel_circumference_m: float = 0.204
    track_width_m: float = 0.15
    distance_scale: float = 1.0
    distance_offset_m: float = 0.0
    diameter_ratio: float = 1.0
    """Right wheels over left, the mean of both kept: E_d of Borenstein & Feng (1996)."""
    turn_source: str = "wheels"
    gyro_bias_rad_s: float = 0.0
    gyro_scale: float = 1.0
    antenna_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    noise: OdometryNoise = field(default_factory=OdometryNoise)

    @property
    def distance_per_tick_m(self) -> float:
        """Distance a wheel rolls from one tick to the next [m]."""
        return self.wheel_circumference_m / self.ticks_per_revolution

    @property
    def side_scales(self) -> tuple[float, float]:
        """Factors of the left and the right wheels' roll, whose mean is one (Borenstein & Feng 1996, eqs. 17, 18)."""
        return 2.0 / (1.0 + self.diameter_ratio), 2.0 * self.diameter_ratio / (1.0 + self.diameter_ratio)


def read_robot(table: object) -> Robot:
    """The robot of a world's table; raises `WorldError` for a key or a value that makes none."""
    robot = read_record(Robot, table, "robot")
    for key, allowed in (("drive", WHEELS), ("encoder", ENCODERS), ("turn_source", TURN_SOURCES)):
        if getattr(robot, key) not in allowed:
            raise WorldError(f"robot.{key}: {getattr(robot, key)!r} is none of {', '.join(allowed)}")
    require_positive(robot, POSITIVE, "robot")
    for key in (item.name for item in dataclasses.fields(robot.noise)):
        if getattr(robot.noise, key) < 0:
            raise WorldError(f"robot.noise.{key}: {getattr(robot.noise, key)} must not be negative")
    return robot
