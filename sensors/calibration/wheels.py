"""Roll of the wheels in a run, before any calibration: the columns that odometry is calibrated from."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from fusion import LogError, MotorCommand, Odometry, WheelTicks
from fusion.arrays import Floats, Whole
from fusion.odometry import Odometer
from fusion.robot import WHEELS, Robot
from fusion.timeline import order
from logs.run import Run


class Wheels(NamedTuple):
    """Cumulative roll of the left and the right side [m] at ``time_ns``, all (n,), by the world's nominal wheels.

    ``lost`` counts the increments so far in which nothing measured the motion. ``resolution_m``: the least roll that
    is measured, 0 where the log holds ready-made increments. ``ready_made``: it holds no ticks, only such increments.
    """

    time_ns: Whole
    left: Floats
    right: Floats
    lost: Whole
    resolution_m: float
    ready_made: bool

    def at(self, time_ns: Whole) -> tuple[Floats, Floats]:
        """Left and right roll at other times, linear in between."""
        return np.interp(time_ns, self.time_ns, self.left), np.interp(time_ns, self.time_ns, self.right)

    def covers(self, from_ns: int, until_ns: int) -> bool:
        """Whether all motion of a time was measured."""
        if from_ns < self.time_ns[0] or until_ns > self.time_ns[-1]:
            return False
        first, last = np.searchsorted(self.time_ns, (from_ns, until_ns), side="left")
        return bool(self.lost[first] == self.lost[last])

    def between(self, from_ns: int, until_ns: int) -> tuple[Floats, Floats]:
        """Left and right roll of each step from ``from_ns`` to ``until_ns``, both cut exactly there."""
        inside = self.time_ns[(self.time_ns > from_ns) & (self.time_ns < until_ns)]
        left, right = self.at(np.concatenate([[from_ns], inside, [until_ns]]))
        return np.diff(left), np.diff(right)


def nominal(robot: Robot) -> Robot:
    """The same robot without any calibration; its nominal track stays."""
    return dataclasses.replace(
        robot, distance_scale=1.0, distance_offset_m=0.0, diameter_ratio=1.0, turn_source="wheels"
    )


def wheels(run: Run) -> Wheels:
    """The wheels of a run; raises `LogError` where it holds none. Ticks win over ready-made increments.

    The host's own `Odometer` reads the ticks, with their signs and resets; its increments are turned back into sides.
    """
    robot = nominal(run.world.robot)
    kinds = {type(measurement) for measurement in run.measurements}
    ready_made = WheelTicks not in kinds or not WHEELS[robot.drive]
    sources = (Odometry,) if ready_made else (WheelTicks, MotorCommand)
    chosen = sorted((m for m in run.measurements if isinstance(m, sources)), key=order)
    steps = _steps(robot, chosen)
    if not steps:
        raise LogError(f"{run.path}: holds no wheel ticks and no odometry; record a run with the wheels on")
    distance, turn = (np.array([getattr(step, key) for step in steps]) for key in ("distance_m", "turn_rad"))
    sideways = 0.5 * robot.track_width_m * turn
    return Wheels(
        np.array([steps[0].from_ns, *(step.time_ns for step in steps)], dtype=np.int64),
        np.concatenate([[0.0], np.cumsum(distance - sideways)]),
        np.concatenate([[0.0], np.cumsum(distance + sideways)]),
        np.concatenate([[0], np.cumsum([not step.measured for step in steps])]),
        0.0 if ready_made else robot.distance_per_tick_m,
        ready_made,
    )


def _steps(robot: Robot, measurements: list[Odometry | WheelTicks | MotorCommand]) -> list[Odometry]:
    """All increments in order of time, those that no time passes in left out."""
    if not measurements:
        return []
    first, steps = measurements[0], list[Odometry]()

    def add(from_ns: int, time_ns: int, distance_m: float, turn_rad: float, measured: bool) -> None:
        if time_ns > from_ns:
            steps.append(Odometry(time_ns, "wheels", len(steps), from_ns, distance_m, turn_rad, measured))

    odometer = Odometer(robot, first.from_ns if isinstance(first, Odometry) else first.time_ns)
    for measurement in measurements:
        odometer.advance(measurement, add)
    return steps
