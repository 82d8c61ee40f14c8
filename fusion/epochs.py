"""The front end of the host: one run's measurements become epochs, once for every estimator.

An epoch is a stretch of motion, pre-integrated, and the radio scan at its end. Estimators therefore meet no wheel, no
gyro and no reading that could not be used; they get the motion since their last epoch as one `Increment`. A stretch
without radio is closed early once it is so long that its calibration derivatives, which are of first order, would no
longer hold. That rule looks at the data alone, so the same measurements always make the same epochs, to the bit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fusion.fates import unusable
from fusion.motion import Increment, Integral
from fusion.odometry import Odometer
from fusion.screen import motion_flaw, screen_radio
from fusion.values import Fate, Gyro, Measurement, Radio, Reason
from fusion.world import World


class Longest(NamedTuple):
    """Limits at which a stretch of motion without radio is closed: the first of these that it reaches.

    At 5 % error of every turn, or a bias of 0.01 rad/s, the heading is then off by some 0.3 rad, and what first order
    leaves out is less than 5 % of the displacement.
    """

    path_m: float = 50.0
    turn_rad: float = math.tau
    duration_s: float = 30.0


LONGEST = Longest()


class Epoch(NamedTuple):
    """The motion since the epoch before, and the ``scan`` at its end: None where a long stretch was closed early."""

    time_ns: int
    motion: Increment
    scan: Radio | None


class FrontEnd:
    """Screening, odometry and pre-integration for one world, from ``start_ns`` on: no motion before it counts."""

    __slots__ = ("_closed", "_integral", "_longest", "_odometer", "_takes_gyro", "_world")

    def __init__(self, world: World, start_ns: int, longest: Longest = LONGEST) -> None:
        self._world = world
        self._longest = longest
        self._takes_gyro = world.robot.turn_source == "gyro"
        self._odometer = Odometer(world.robot, start_ns)
        self._integral = Integral(world.robot.noise, Increment(time_ns=start_ns))
        self._closed: tuple[Epoch, ...] = ()

    def copy(self) -> FrontEnd:
        """Another one in the same state, which goes on by itself."""
        twin = object.__new__(FrontEnd)
        twin._world, twin._longest, twin._takes_gyro = self._world, self._longest, self._takes_gyro
        twin._odometer, twin._integral, twin._closed = self._odometer.copy(), self._integral.copy(), ()
        return twin

    @property
    def motion(self) -> Increment:
        """The motion since the last epoch."""
        return self._integral.increment

    def advance(self, measurement: Measurement) -> tuple[tuple[Epoch, ...], tuple[Fate, ...]]:
        """The epochs that a measurement closes, and the Fates of what could not be used.

        Raises `MeasurementError` for motion of more or fewer wheels than the robot has; nothing has changed then.
        """
        if isinstance(measurement, Radio):
            return self._scanned(measurement)
        if (reason := motion_flaw(measurement)) is not None:
            return (), unusable(measurement, reason)
        if not self._takes_gyro and isinstance(measurement, Gyro):
            return (), unusable(measurement, Reason.KIND_NOT_CONSUMED)
        self._odometer.advance(measurement, self._extend)
        return self._taken() if self._closed else (), ()

    def held(self, time_ns: int) -> Increment:
        """The motion since the last epoch, held on the last twist up to ``time_ns``. It closes no epoch, so asking
        changes nothing.
        """
        integral = self._integral.copy()
        self._odometer.copy().hold(time_ns, integral.extend)
        return integral.increment

    def _scanned(self, scan: Radio) -> tuple[tuple[Epoch, ...], tuple[Fate, ...]]:
        kept, fates = screen_radio(self._world, scan)
        if kept is None:
            return (), fates
        self._odometer.hold(kept.time_ns, self._extend)
        self._close(kept.time_ns, kept)
        return self._taken(), fates

    def _extend(self, from_ns: int, time_ns: int, distance_m: float, turn_rad: float, measured: bool) -> None:
        """One step more, and the end of the epoch where it has grown too long."""
        motion, longest = self._integral, self._longest
        motion.extend(from_ns, time_ns, distance_m, turn_rad, measured)
        if (
            motion.path_m >= longest.path_m
            or abs(motion.heading) >= longest.turn_rad
            or motion.duration_s >= longest.duration_s
        ):
            self._close(time_ns, None)

    def _close(self, time_ns: int, scan: Radio | None) -> None:
        self._closed = (*self._closed, Epoch(time_ns, self._integral.increment, scan))
        self._integral.restart(Increment(time_ns=time_ns))

    def _taken(self) -> tuple[Epoch, ...]:
        closed, self._closed = self._closed, ()
        return closed
