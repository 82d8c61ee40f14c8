"""Recorder of everything that the sensors of a robot emit, and of the states of sensors, disk and clocks."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import NamedTuple

from fusion import Diagnostic, Level, LogError, PluginError, Prior, Update
from fusion.values import nanoseconds, seconds
from logs.devices import STATUS
from sensors.onboard.driver_lifecycle import Received, State
from sensors.onboard.robot_file import Policy, RobotFile
from sensors.onboard.rolling_log import RollingLog, check_space
from sensors.onboard.sensor_loop import PATIENCE_S, Batch, Report, SensorLoop, check_duration
from sensors.onboard.supervisor import Status

DISK_S, CLOCK_S = 5.0, 10.0
"""Periods at which the free disk is looked at, and the clocks are compared."""

Answers = Sequence[tuple[str, Update]]
"""Updates by one message, each with the name of its estimator."""


class Recorded(NamedTuple):
    """Result of a recording. ``trouble`` is why it ended by itself, "" where it was stopped; ``warning`` is
    what makes it misleading all the same, "" where nothing is known to.
    """

    paths: tuple[Path, ...]
    statuses: tuple[Status, ...]
    duration_s: float
    trouble: str
    warning: str = ""


def record(
    robot: RobotFile,
    folder: Path,
    *,
    stop: threading.Event,
    duration_s: float | None = None,
    degraded: bool = False,
    fail_fast: bool = False,
    patience_s: float = PATIENCE_S,
    on_status: Callable[[Sequence[Status], str], None] = lambda _statuses, _warning: None,
) -> Recorded:
    """Record until ``stop`` is set, the time is over, or it cannot go on; ``on_status`` is called each second with the
    status of every sensor and the warning of `Recorded` as it stands then.

    Raises `ParameterError` for a duration that is none, `LogError` where nothing can be written, `DriverError` where a
    required sensor does not open (unless ``degraded``), all before anything is recorded.
    """
    check_duration(duration_s)
    loop = SensorLoop(robot, fail_fast=fail_fast)
    check_policy(robot.policy, folder)
    with loop:
        if not degraded:
            loop.await_open(patience_s, stop)
        with Recorder(robot, folder, robot.start.prior(loop.began_ns, robot.world)) as recorder:
            for batch in loop.batches(stop, duration_s):
                recorder.take(batch)
                if batch.report is not None:
                    on_status(batch.report.statuses, loop.warning)
                if recorder.trouble:
                    loop.end(recorder.trouble)
    duration_s = seconds(loop.clock.now_ns() - loop.began_ns)
    return Recorded(recorder.paths, tuple(loop.statuses()), duration_s, loop.trouble, loop.warning)


def check_policy(policy: Policy, folder: Path) -> None:
    """Refuse a recording that would have to stop at once; raises `LogError`."""
    check_space(folder, 0.0 if policy.ring else policy.min_free_mb)


class Recorder:
    """Writes every batch into a log; a context manager, for one thread. ``trouble`` is why it cannot go on, "" while it
    can: a disk that refuses something ends the recording, and nothing that is on it is lost. ``refused``:
    estimators of which an update fits no log, each with the reason; no more of theirs is written.
    """

    def __init__(
        self, robot: RobotFile, folder: Path, prior: Prior, about: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Begin a log in ``folder``; ``about`` goes into its metadata. Raises `LogError` where none can be."""
        self.trouble = ""
        self.refused: dict[str, str] = {}
        self._log = RollingLog(robot, folder, prior, about)
        self._due_ns = dict.fromkeys((self._look_at_disk, self._compare_clocks), prior.time_ns)
        self._every_s = {self._look_at_disk: DISK_S, self._compare_clocks: CLOCK_S}

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files so far."""
        return tuple(self._log.paths)

    def close(self) -> None:
        """Finish the last file; raises `LogError` where that cannot be."""
        self._log.close()

    def take(self, batch: Batch, answers: Iterable[Answers] | None = None) -> None:
        """Write what arrived, each followed by the updates by it, and at its own pace everything else."""
        try:
            for received, updates in zip(batch.received, repeat(()) if answers is None else answers, strict=False):
                self._log.write(received)
                for estimator, update in updates:
                    self._write_update(estimator, update, received.received_ns)
            if batch.report is not None:
                self._keep(batch.report, batch.now_ns)
            for task in [task for task, due_ns in self._due_ns.items() if due_ns <= batch.now_ns]:
                task()
                self._due_ns[task] = batch.now_ns + nanoseconds(self._every_s[task])
            self._log.split_if_due(batch.now_ns)
        except LogError as error:
            self.trouble = str(error)

    def note(self, about: Mapping[str, str]) -> None:
        """Add what is known only at the end to the metadata of the last file."""
        try:
            self._log.note(about)
        except LogError as error:
            self.trouble = str(error)

    def write_diagnostic(self, diagnostic: Diagnostic) -> None:
        """Write a diagnostic of the recording program itself."""
        try:
            self._log.write(Received(diagnostic.time_ns, diagnostic))
        except LogError as error:
            self.trouble = str(error)

    def _write_update(self, estimator: str, update: Update, now_ns: int) -> None:
        if estimator in self.refused:
            return
        try:
            self._log.write_update(estimator, update, now_ns)
        except PluginError as error:
            self.refused[estimator] = str(error)

    def _keep(self, report: Report, now_ns: int) -> None:
        self._log.write_devices(report.devices, now_ns)
        for status in report.statuses:
            self._log.write(Received(now_ns, _as_diagnostic(status, now_ns)))

    def _look_at_disk(self) -> None:
        lacks_mb = self._log.lacks_mb()
        if lacks_mb > 0.0:
            self.trouble = f"the disk is nearly full: {lacks_mb:.0f} MB less free than --min-free asks for; free some"

    def _compare_clocks(self) -> None:
        self._log.write_clock()


def _as_diagnostic(status: Status, now_ns: int) -> Diagnostic:
    values = tuple((key, str(value)) for key, value in status.record.items() if value not in (None, ""))
    level = {State.RUNNING: Level.OK, State.FAILED: Level.ERROR}.get(status.state, Level.WARN)
    return Diagnostic(now_ns, status.name, level, STATUS, values)
