"""The front end of the host: one run's measurements become epochs, once for every estimator.

An epoch is a stretch of motion, pre-integrated, and the radio scan at its end. Estimators therefore meet no wheel, no
gyro and no reading that could not be used; they get the motion since their last epoch as one `Increment`. A stretch
without radio is closed early once it is so long that its calibration derivatives, which are of first order, would no
longer hold. That rule looks at the data alone, so the same measurements always make the same epochs, to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from fusion.fates import unusable
from fusion.motion import Increment
from fusion.odometry import Odometer, OdometerState
from fusion.screen import screen
from fusion.values import Fate, Gyro, Measurement, Odometry, Radio, Reason
from fusion.world import World


class Longest(NamedTuple):
    """Limits at which a stretch of motion without radio is closed: the first of these that it reaches.

    At 5 % error of every turn, or a bias of 0.01 rad/s, the heading is then off by some 0.3 rad, and what first order
    leaves out is less than 5 % of the displacement.
    """

    path_m: float = 50.0
    turn_rad: float = math.tau
    duration_s: float = 30.0

    def reached(self, motion: Increment) -> bool:
        """Whether ``motion`` is to be closed."""
        return (
            motion.path_m >= self.path_m or abs(motion.heading) >= self.turn_rad or motion.duration_s >= self.duration_s
        )


LONGEST = Longest()


class Epoch(NamedTuple):
    """The motion since the epoch before, and the ``scan`` at its end: None where a long stretch was closed early."""

    time_ns: int
    motion: Increment
    scan: Radio | None


class FrontEndState(NamedTuple):
    """Memory of the front end: the odometer, and the motion since the last epoch."""

    odometer: OdometerState
    motion: Increment


class FrontEnd:
    """Screening, odometry and pre-integration for one world. Holds the world only; the state is a value."""

    def __init__(self, world: World, longest: Longest = LONGEST) -> None:
        self._world = world
        self._longest = longest
        self._noise = world.robot.noise
        self._odometer = Odometer(world.robot)
        self._takes_gyro = world.robot.turn_source == "gyro"

    def start(self, time_ns: int) -> FrontEndState:
        """No motion before ``time_ns`` counts."""
        return FrontEndState(self._odometer.start(time_ns), Increment(time_ns=time_ns))

    def advance(
        self, state: FrontEndState, measurement: Measurement
    ) -> tuple[FrontEndState, tuple[Epoch, ...], tuple[Fate, ...]]:
        """The state after a measurement, the epochs that it closed, and the Fates of what could not be used.

        Raises `MeasurementError` for motion of more or fewer wheels than the robot has.
        """
        kept, fates = screen(self._world, measurement)
        if kept is None:
            return state, (), fates
        if isinstance(kept, Radio):
            odometer, steps = self._odometer.hold(state.odometer, kept.time_ns)
            motion, closed = self._integrated(state.motion, steps)
            epoch = Epoch(kept.time_ns, motion, kept)
            return FrontEndState(odometer, Increment(time_ns=kept.time_ns)), (*closed, epoch), fates
        if isinstance(kept, Gyro) and not self._takes_gyro:
            return state, (), unusable(kept, Reason.KIND_NOT_CONSUMED)
        odometer, steps = self._odometer.advance(state.odometer, kept)
        motion, closed = self._integrated(state.motion, steps)
        return FrontEndState(odometer, motion), closed, fates

    def held(self, state: FrontEndState, time_ns: int) -> Increment:
        """The motion since the last epoch, held on the last twist up to ``time_ns``. It closes no epoch, so asking
        changes nothing.
        """
        motion = state.motion
        for step in self._odometer.hold(state.odometer, time_ns)[1]:
            motion = motion.extend(step, self._noise)
        return motion

    def _integrated(self, motion: Increment, steps: Sequence[Odometry]) -> tuple[Increment, tuple[Epoch, ...]]:
        """``motion`` followed by the steps, and the epochs closed on the way."""
        closed: tuple[Epoch, ...] = ()
        for step in steps:
            motion = motion.extend(step, self._noise)
            if self._longest.reached(motion):
                closed = (*closed, Epoch(step.time_ns, motion, None))
                motion = Increment(time_ns=step.time_ns)
        return motion, closed
