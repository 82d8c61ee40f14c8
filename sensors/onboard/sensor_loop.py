"""The one loop over a robot's sensors, of a recording, of a live pose, or of both.

One thread a driver, and the caller's own, which takes batches: what arrived since the last one, and once a second the
status of every sensor. The heartbeat for the service manager comes from here, so that a caller that hangs is restarted.
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
from sensors.onboard.computer import notify_service_manager
from sensors.onboard.driver_lifecycle import DriverLifecycle, Received, State
from sensors.onboard.robot_file import RobotFile, build_driver
from sensors.onboard.supervisor import Status, Supervisor

TAKE_S = 0.2
"""Longest time of a batch."""
STATUS_S = 1.0
"""Period of the status reports."""
PATIENCE_S = 10.0
"""Time in which a required sensor must open."""


class Report(NamedTuple):
    """Status of every sensor, in the order of the robot file, and the description of every open device by sensor."""

    statuses: Sequence[Status]
    devices: Mapping[str, DeviceInfo]


class Batch(NamedTuple):
    """One pass of the loop: what arrived, by time of arrival. ``tick``: the tick that was asked for is due; ``report``:
    once a second, None between.
    """

    now_ns: int
    received: Sequence[Received]
    tick: bool
    report: Report | None


class SensorLoop:
    """All sensors of a robot, running within a ``with`` block. ``trouble`` is why the batches ended by
    themselves, "" where they were stopped.
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
        self._lifecycles = [
            DriverLifecycle(sensor.name, build_driver(sensor, self.clock), self.clock, fail_fast=fail_fast, seed=number)
            for number, sensor in enumerate(robot.sensors)
        ]
        self._required = [k for k, sensor in zip(self._lifecycles, robot.sensors, strict=True) if sensor.required]
        if advice := caution(robot.world.robot, {kind for one in self._lifecycles for kind in one.driver.spec.kinds}):
            raise SettingError(advice.what, advice.cure)
        self._direction = DirectionWatch(robot.world.robot)
        self._supervisor = Supervisor(self._lifecycles, self.clock)
        self._is_over = False

    def __enter__(self) -> SensorLoop:
        self._supervisor.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._supervisor.close()

    def await_open(self, patience_s: float, stop: threading.Event) -> None:
        """Wait until every required sensor is open; raises `NotFoundError` with those that are not, and the reasons."""
        until_ns = self.clock.now_ns() + nanoseconds(patience_s)
        while missing := [lifecycle for lifecycle in self._required if lifecycle.info is None]:
            hopeless = any(lifecycle.state is State.FAILED for lifecycle in missing)
            if hopeless or self.clock.now_ns() >= until_ns or stop.is_set():
                causes = "; ".join(
                    f"{lifecycle.name}: {lifecycle.error or 'it takes too long to open'}" for lifecycle in missing
                )
                raise NotFoundError(
                    f"required sensors are missing: {causes}",
                    "go on without them by --degraded, or set required = false",
                )
            stop.wait(0.05)

    def batches(
        self, stop: threading.Event, duration_s: float | None = None, tick_s: float = STATUS_S
    ) -> Iterator[Batch]:
        """Batches until ``stop`` is set, the time is over, or `end`; the last one holds what arrived until every
        driver was closed.
        """
        notify_service_manager("READY=1")
        began_ns = self.clock.now_ns()
        until_ns = None if duration_s is None else began_ns + nanoseconds(duration_s)
        tick, report = _Pace(began_ns, tick_s), _Pace(began_ns, STATUS_S)
        while not (stop.is_set() or self._is_over or (until_ns is not None and self.clock.now_ns() >= until_ns)):
            yield self._batch(tick, report)
        notify_service_manager("STOPPING=1")
        self._supervisor.close()
        yield self._batch(tick, report)

    def end(self, trouble: str) -> None:
        """Let the next batch be the last."""
        self.trouble = self.trouble or trouble
        self._is_over = True

    @property
    def warning(self) -> str:
        """Cause that makes the measurements misleading though every sensor may do well, "" where none is known."""
        return str(self._direction.caution or "")

    def statuses(self) -> Sequence[Status]:
        """Status of every sensor now."""
        return self._supervisor.statuses()

    def _batch(self, tick: _Pace, report: _Pace) -> Batch:
        left_s = seconds(tick.due_ns - self.clock.now_ns())
        received = self._supervisor.take(min(max(left_s, 0.0), TAKE_S))
        for one in received:
            self._direction.take(one.output)
        now_ns = self.clock.now_ns()
        return Batch(now_ns, received, tick.is_due(now_ns), self._report() if report.is_due(now_ns) else None)

    def _report(self) -> Report:
        notify_service_manager("WATCHDOG=1")
        statuses = self.statuses()
        for status in statuses:  # one whose device holds it up reports nothing
            if status.state is not State.RUNNING:
                self._direction.lose(status.name)
        failed = [status for status in statuses if status.state is State.FAILED]
        if failed and self._fail_fast:
            self.end(failed[0].error)
        return Report(statuses, {one.name: one.info for one in self._lifecycles if one.info is not None})


def check_duration(duration_s: float | None) -> None:
    """Refuse a time that is none, with a `ParameterError`."""
    if duration_s is not None and not 0.0 < duration_s < math.inf:
        raise ParameterError(
            f"duration {duration_s} s: must be a time greater than zero; leave it out to go on until stopped"
        )


class _Pace:
    """A tick that comes at once and then every so often; one that is missed is left out, not made up for."""

    def __init__(self, now_ns: int, every_s: float) -> None:
        self.due_ns = now_ns
        self._every_ns = nanoseconds(every_s)

    def is_due(self, now_ns: int) -> bool:
        if now_ns < self.due_ns:
            return False
        self.due_ns += self._every_ns * ((now_ns - self.due_ns) // self._every_ns + 1)
        return True
