"""The one loop of everything that listens to a robot's sensors: a recording, a pose now, or both.

One thread a driver, and the caller's own, which takes turns: what came since the last turn, once a second how every
sensor does. The heartbeat for the service manager comes from here, so that a caller who hangs is started anew.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping, Sequence
from types import TracebackType
from typing import NamedTuple

from fusion import BootClock, DeviceInfo, NotFoundError, ParameterError, SettingError
from fusion.values import nanoseconds, seconds
from logs.wheel_direction import DirectionWatch, caution
from sensors.onboard.computer import tell_service_manager
from sensors.onboard.driver_lifecycle import Keeper, Received, State
from sensors.onboard.robot_file import RobotFile, build_driver
from sensors.onboard.supervisor import Status, Supervisor

TAKE_S = 0.2
"""Longest time of a turn."""
STATUS_S = 1.0
"""How often it is told how sensors do."""
PATIENCE_S = 10.0
"""How long a required sensor may take to open."""


class Report(NamedTuple):
    """How every sensor does, in the order of the robot file, and what the open devices say of themselves."""

    statuses: Sequence[Status]
    devices: Mapping[str, DeviceInfo]


class Turn(NamedTuple):
    """One turn of the loop: what came, by time of arrival. ``beat``: the beat that was asked for is due; ``report``:
    once a second, None between.
    """

    now_ns: int
    received: Sequence[Received]
    beat: bool
    report: Report | None


class Sensing:
    """All sensors of a robot, running within a ``with`` block. ``trouble`` is why the turns ended by themselves, ""
    where they were stopped.
    """

    def __init__(self, robot: RobotFile, *, fail_fast: bool = False) -> None:
        """Build every driver and open no device; raises `DriverError` or `PluginError`, and `SettingError` for encoders
        that cannot do without motor commands where no sensor brings any.
        """
        self.trouble = ""
        self.clock = BootClock()
        self.began_ns = self.clock.now_ns()
        """Before anything can be measured: the time of the prior, since the first command to the motors must not be
        older than it."""
        self._fail_fast = fail_fast
        self._keepers = [
            Keeper(sensor.name, build_driver(sensor, self.clock), self.clock, fail_fast=fail_fast, seed=number)
            for number, sensor in enumerate(robot.sensors)
        ]
        self._required = [k for k, sensor in zip(self._keepers, robot.sensors, strict=True) if sensor.required]
        if found := caution(robot.world.robot, {kind for one in self._keepers for kind in one.driver.spec.kinds}):
            raise SettingError(found.what, found.cure)
        self._direction = DirectionWatch(robot.world.robot)
        self._supervisor = Supervisor(self._keepers, self.clock)
        self._is_over = False

    def __enter__(self) -> Sensing:
        self._supervisor.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._supervisor.close()

    def await_open(self, patience_s: float, stop: threading.Event) -> None:
        """Wait until every required sensor is open; raises `NotFoundError` that names those that are not, and why."""
        until_ns = self.clock.now_ns() + nanoseconds(patience_s)
        while missing := [keeper for keeper in self._required if keeper.info is None]:
            hopeless = any(keeper.state is State.FAILED for keeper in missing)
            if hopeless or self.clock.now_ns() >= until_ns or stop.is_set():
                causes = "; ".join(
                    f"{keeper.name}: {keeper.error or 'it takes too long to open'}" for keeper in missing
                )
                raise NotFoundError(
                    f"required sensors are missing: {causes}",
                    "go on without them by --degraded, or set required = false",
                )
            stop.wait(0.05)

    def turns(self, stop: threading.Event, duration_s: float | None = None, beat_s: float = STATUS_S) -> Iterator[Turn]:
        """Turn by turn until ``stop`` is set, the time is over, or `end`; the last one holds what came until every
        driver was let go.
        """
        tell_service_manager("READY=1")
        began_ns = self.clock.now_ns()
        until_ns = None if duration_s is None else began_ns + nanoseconds(duration_s)
        beat, report = _Pace(began_ns, beat_s), _Pace(began_ns, STATUS_S)
        while not (stop.is_set() or self._is_over or (until_ns is not None and self.clock.now_ns() >= until_ns)):
            yield self._turn(beat, report)
        tell_service_manager("STOPPING=1")
        self._supervisor.close()
        yield self._turn(beat, report)

    def end(self, trouble: str) -> None:
        """Let the next turn be the last."""
        self.trouble = self.trouble or trouble
        self._is_over = True

    @property
    def warning(self) -> str:
        """What makes the measurements misleading though every sensor may do well, "" where nothing is known to."""
        return str(self._direction.caution or "")

    def statuses(self) -> Sequence[Status]:
        """How every sensor does now."""
        return self._supervisor.statuses()

    def _turn(self, beat: _Pace, report: _Pace) -> Turn:
        left_s = seconds(beat.due_ns - self.clock.now_ns())
        received = self._supervisor.take(min(max(left_s, 0.0), TAKE_S))
        for one in received:
            self._direction.take(one.said)
        now_ns = self.clock.now_ns()
        return Turn(now_ns, received, beat.is_due(now_ns), self._report() if report.is_due(now_ns) else None)

    def _report(self) -> Report:
        tell_service_manager("WATCHDOG=1")
        statuses = self.statuses()
        for status in statuses:  # one whose device holds it up reports nothing
            if status.state is not State.RUNNING:
                self._direction.lose(status.name)
        failed = [status for status in statuses if status.state is State.FAILED]
        if failed and self._fail_fast:
            self.end(failed[0].error)
        return Report(statuses, {keeper.name: keeper.info for keeper in self._keepers if keeper.info is not None})


def check_duration(duration_s: float | None) -> None:
    """Refuse a time that is none, with a `ParameterError`."""
    if duration_s is not None and not 0.0 < duration_s < math.inf:
        raise ParameterError(
            f"duration {duration_s} s: must be a time greater than zero; leave it out to go on until stopped"
        )


class _Pace:
    """A beat that comes at once and then every so often; one that is missed is left out, not made up for."""

    def __init__(self, now_ns: int, every_s: float) -> None:
        self.due_ns = now_ns
        self._every_ns = nanoseconds(every_s)

    def is_due(self, now_ns: int) -> bool:
        if now_ns < self.due_ns:
            return False
        self.due_ns += self._every_ns * ((now_ns - self.due_ns) // self._every_ns + 1)
        return True
