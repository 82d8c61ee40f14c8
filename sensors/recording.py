"""The loop of a recording: one thread a driver, and one that alone writes.

Each second it tells how every sensor does, to the log, to the person and to the service manager; the log is flushed
and synced as often.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from fusion import BootClock, Clock, DeviceInfo, Level, LogError, NotFoundError, Remark
from fusion.values import nanoseconds, seconds
from logs.devices import STATUS
from sensors.computer import tell_service_manager
from sensors.keeper import Keeper, Received, State
from sensors.robot_file import RobotFile, build_driver
from sensors.split_log import SplitLog, check_space
from sensors.supervisor import Status, Supervisor

TAKE_S = 0.2
STATUS_S, DISK_S, CLOCK_S = 1.0, 5.0, 10.0
"""How often all that is told, the free disk looked at, the clocks compared."""
PATIENCE_S = 10.0
"""How long a required sensor may take to open."""


class Recorded(NamedTuple):
    """What came of a recording. ``trouble`` is why it ended by itself, "" where it was stopped."""

    paths: tuple[Path, ...]
    statuses: tuple[Status, ...]
    duration_s: float
    trouble: str


def record(
    robot: RobotFile,
    folder: Path,
    *,
    stop: threading.Event,
    duration_s: float | None = None,
    degraded: bool = False,
    fail_fast: bool = False,
    patience_s: float = PATIENCE_S,
    tell: Callable[[Sequence[Status]], None] = lambda _: None,
) -> Recorded:
    """Record until ``stop`` is set, the time is over, or it cannot go on; ``tell`` hears each second how sensors do.

    Raises `LogError` where nothing can be written, `DriverError` where a required sensor does not open (unless
    ``degraded``), both before anything is recorded.
    """
    clock = BootClock()
    keepers = [
        Keeper(sensor.name, build_driver(sensor, clock), clock, fail_fast=fail_fast, seed=number)
        for number, sensor in enumerate(robot.sensors)
    ]
    check_space(folder, 0.0 if robot.policy.ring else robot.policy.min_free_mb)
    required = [] if degraded else [k for k, sensor in zip(keepers, robot.sensors, strict=True) if sensor.required]
    with Supervisor(keepers, clock) as supervisor:
        await_open(required, clock, patience_s, stop)
        began_ns = clock.now_ns()
        with SplitLog(robot, folder, robot.start.prior(began_ns, robot.world)) as log:
            writing = _Writing(log, supervisor, keepers, clock, fail_fast=fail_fast, tell=tell)
            tell_service_manager("READY=1")
            until_ns = None if duration_s is None else began_ns + nanoseconds(duration_s)
            while not (stop.is_set() or writing.trouble or (until_ns is not None and clock.now_ns() >= until_ns)):
                writing.turn()
            tell_service_manager("STOPPING=1")
            supervisor.close()
            writing.turn()  # what came until the last driver was let go
    return Recorded(tuple(log.paths), tuple(supervisor.statuses()), seconds(clock.now_ns() - began_ns), writing.trouble)


def await_open(required: Sequence[Keeper], clock: Clock, patience_s: float, stop: threading.Event) -> None:
    """Wait until every required sensor is open; raises `NotFoundError` that names those that are not, and why."""
    until_ns = clock.now_ns() + nanoseconds(patience_s)
    while missing := [keeper for keeper in required if keeper.info is None]:
        hopeless = any(keeper.state is State.FAILED for keeper in missing)
        if hopeless or clock.now_ns() >= until_ns or stop.is_set():
            causes = "; ".join(f"{keeper.name}: {keeper.error or 'it takes too long to open'}" for keeper in missing)
            raise NotFoundError(
                f"required sensors are missing: {causes}", "go on without them by --degraded, or set required = false"
            )
        stop.wait(0.05)


class _Writing:
    """The loop of the one thread that writes: what came, and at its own pace everything else."""

    def __init__(
        self,
        log: SplitLog,
        supervisor: Supervisor,
        keepers: Sequence[Keeper],
        clock: Clock,
        *,
        fail_fast: bool,
        tell: Callable[[Sequence[Status]], None],
    ) -> None:
        self.trouble = ""
        self._log, self._supervisor, self._keepers, self._clock = log, supervisor, keepers, clock
        self._fail_fast = fail_fast
        self._tell = tell
        now_ns = clock.now_ns()
        self._due_ns = dict.fromkeys((self._report, self._look_at_disk, self._compare_clocks), now_ns)
        self._every_s = {self._report: STATUS_S, self._look_at_disk: DISK_S, self._compare_clocks: CLOCK_S}

    def turn(self) -> None:
        """Write what came; a disk that refuses it ends the recording, and nothing that is on it is lost."""
        try:
            for received in self._supervisor.take(TAKE_S):
                self._log.write(received)
            now_ns = self._clock.now_ns()
            for task in [task for task, due_ns in self._due_ns.items() if due_ns <= now_ns]:
                task(now_ns)
                self._due_ns[task] = now_ns + nanoseconds(self._every_s[task])
            self._log.split_if_due(now_ns)
        except LogError as error:
            self.trouble = str(error)

    def _report(self, now_ns: int) -> None:
        self._log.write_devices(_devices(self._keepers), now_ns)
        statuses = self._supervisor.statuses()
        for status in statuses:
            self._log.write(Received(now_ns, _as_remark(status, now_ns)))
        self._tell(statuses)
        tell_service_manager("WATCHDOG=1")
        failed = [status for status in statuses if status.state is State.FAILED]
        if failed and self._fail_fast:
            self.trouble = failed[0].error

    def _look_at_disk(self, _now_ns: int) -> None:
        lacks_mb = self._log.lacks_mb()
        if lacks_mb > 0.0:
            self.trouble = f"the disk is nearly full: {lacks_mb:.0f} MB less free than --min-free asks for; free some"

    def _compare_clocks(self, _now_ns: int) -> None:
        self._log.write_clock()


def _devices(keepers: Sequence[Keeper]) -> dict[str, DeviceInfo]:
    return {keeper.name: keeper.info for keeper in keepers if keeper.info is not None}


def _as_remark(status: Status, now_ns: int) -> Remark:
    values = [(key, str(value)) for key, value in status._asdict().items() if value not in (None, "")]
    level = {State.RUNNING: Level.OK, State.FAILED: Level.ERROR}.get(status.state, Level.WARN)
    named = dict(values) | {"state": status.state.value}
    return Remark(now_ns, status.name, level, STATUS, tuple(named.items()))
