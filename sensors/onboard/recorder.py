"""What keeps a log of all that the sensors of a robot say, and of how they, the disk and the clocks do."""

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
from sensors.onboard.rolling_log import SplitLog, check_space
from sensors.onboard.sensor_loop import PATIENCE_S, Report, Sensing, Turn, check_duration
from sensors.onboard.supervisor import Status

DISK_S, CLOCK_S = 5.0, 10.0
"""How often the free disk is looked at, the clocks compared."""

Answers = Sequence[tuple[str, Update]]
"""What estimators said to one message, each with the name of its lane."""


class Recorded(NamedTuple):
    """What came of a recording. ``trouble`` is why it ended by itself, "" where it was stopped; ``warning`` is
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
    tell: Callable[[Sequence[Status], str], None] = lambda _statuses, _warning: None,
) -> Recorded:
    """Record until ``stop`` is set, the time is over, or it cannot go on; ``tell`` is given each second how sensors do,
    and the warning of `Recorded` as it stands then.

    Raises `ParameterError` for a duration that is none, `LogError` where nothing can be written, `DriverError` where a
    required sensor does not open (unless ``degraded``), all before anything is recorded.
    """
    check_duration(duration_s)
    sensing = Sensing(robot, fail_fast=fail_fast)
    check_policy(robot.policy, folder)
    with sensing:
        if not degraded:
            sensing.await_open(patience_s, stop)
        with Recorder(robot, folder, robot.start.prior(sensing.began_ns, robot.world)) as recorder:
            for turn in sensing.turns(stop, duration_s):
                recorder.take(turn)
                if turn.report is not None:
                    tell(turn.report.statuses, sensing.warning)
                if recorder.trouble:
                    sensing.end(recorder.trouble)
    duration_s = seconds(sensing.clock.now_ns() - sensing.began_ns)
    return Recorded(recorder.paths, tuple(sensing.statuses()), duration_s, sensing.trouble, sensing.warning)


def check_policy(policy: Policy, folder: Path) -> None:
    """Refuse a recording that would have to stop at once; raises `LogError`."""
    check_space(folder, 0.0 if policy.ring else policy.min_free_mb)


class Recorder:
    """Writes every turn into a log; a context manager, for one thread. ``trouble`` is why it cannot go on, "" while it
    can: a disk that refuses something ends the recording, and nothing that is on it is lost. ``refused``: lanes of
    estimators that said something no log can hold, each with the reason; no more of those is written.
    """

    def __init__(
        self, robot: RobotFile, folder: Path, prior: Prior, about: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Begin a log in ``folder``; ``about`` goes into its metadata. Raises `LogError` where none can be."""
        self.trouble = ""
        self.refused: dict[str, str] = {}
        self._log = SplitLog(robot, folder, prior, about)
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

    def take(self, turn: Turn, answers: Iterable[Answers] | None = None) -> None:
        """Write what came, each followed by what estimators said to it, and at its own pace everything else."""
        try:
            for received, said in zip(turn.received, repeat(()) if answers is None else answers, strict=False):
                self._log.write(received)
                for lane, update in said:
                    self._write_update(lane, update, received.received_ns)
            if turn.report is not None:
                self._keep(turn.report, turn.now_ns)
            for task in [task for task, due_ns in self._due_ns.items() if due_ns <= turn.now_ns]:
                task()
                self._due_ns[task] = turn.now_ns + nanoseconds(self._every_s[task])
            self._log.split_if_due(turn.now_ns)
        except LogError as error:
            self.trouble = str(error)

    def note(self, about: Mapping[str, str]) -> None:
        """Add what is known only at the end to the metadata of the last file."""
        try:
            self._log.note(about)
        except LogError as error:
            self.trouble = str(error)

    def diagnostic(self, diagnostic: Diagnostic) -> None:
        """Write a diagnostic of our own."""
        try:
            self._log.write(Received(diagnostic.time_ns, diagnostic))
        except LogError as error:
            self.trouble = str(error)

    def _write_update(self, lane: str, update: Update, now_ns: int) -> None:
        if lane in self.refused:
            return
        try:
            self._log.write_update(lane, update, now_ns)
        except PluginError as error:
            self.refused[lane] = str(error)

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
