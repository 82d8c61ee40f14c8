"""Tasks over several processes, one at a time in each, so that one that dies or hangs takes nothing with it but itself.

A worker that dies costs its task one more try in a fresh process; one that dies twice is lost. A task that takes too
long or too much memory is lost at once, with its process: it would do so again. What the process pools of the
standard library and of joblib lose in such a case is everything that was submitted. No process outlives the one that
started it.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from enum import Enum, unique
from multiprocessing import get_context
from multiprocessing.connection import wait
from typing import Any, Generic, NamedTuple, TypeVar

from benchmarks.runner.worker_process import OUT_OF_MEMORY, Answer, serve
from fusion import FusionError

Task = TypeVar("Task")
Result = TypeVar("Result")

_PROCESSES = threading.RLock()
"""Held to start a process or to learn how one ended: whenever `multiprocessing` starts one, in whatever thread, it
buries all that have ended, and another thread that asks at that moment gets no exit code.
"""


class Limits(NamedTuple):
    """Limits of one task; None: all there is."""

    wall_s: float | None = None
    rss_mb: float | None = None


@unique
class TaskFailure(Enum):
    """Reasons why a task has no result."""

    CRASHED = "crashed"
    TIMEOUT = "timeout"
    OUT_OF_MEMORY = "oom"


def compute(
    work: Callable[[Task], Result],
    lost: Callable[[Task, TaskFailure], Result],
    tasks: Sequence[Task],
    workers: int,
    limits: Limits | None = None,
) -> Iterator[tuple[int, Result]]:
    """(index, result) of every task as it is done; ``lost`` answers for one that has none.

    One worker without limits: in this process, in order, nothing started. What ``work`` raises is raised here.
    """
    if workers <= 1 and limits is None:
        yield from ((index, work(task)) for index, task in enumerate(tasks))
        return
    pool = WorkerPool(work, lost, limits or Limits())
    try:
        yield from pool.compute(tasks, workers)
    finally:
        pool.dismiss()


class WorkerPool(Generic[Task, Result]):
    """The processes at work: started when they are needed, and kept for the next tasks until they are dismissed.

    One that has nothing to do for ``idle_s`` ends by itself; None: never.
    """

    def __init__(
        self,
        work: Callable[[Task], Result],
        lost: Callable[[Task, TaskFailure], Result],
        limits: Limits,
        idle_s: float | None = None,
    ) -> None:
        self._work, self._lost, self._limits, self._idle_s = work, lost, limits, idle_s
        self._workers: list[_Worker] = []
        self._dismissed = False

    def compute(self, tasks: Sequence[Task], workers: int) -> Iterator[tuple[int, Result]]:
        """As `compute`, in up to ``workers`` processes. Raises `CancelledError` once another thread dismisses them.

        Several processes whose tasks were not all answered, as after an error, are of no further use.
        """
        waiting, died = deque(range(len(tasks))), set[int]()
        self._workers = [worker for worker in self._workers if not isinstance(worker.listen(), TaskFailure)]
        while waiting or self._busy:
            self._staff(min(workers, len(waiting) + self._busy))
            for index, answer in self._turn(waiting, tasks):
                if not isinstance(answer, TaskFailure):
                    yield index, answer.result()
                elif answer is TaskFailure.CRASHED and index not in died:
                    died.add(index)
                    waiting.appendleft(index)
                else:
                    yield index, self._lost(tasks[index], answer)

    def dismiss(self) -> None:
        """End every process, at work or not, for good."""
        with _PROCESSES:
            self._dismissed = True
            for worker in self._workers:
                worker.kill()

    @property
    def _busy(self) -> int:
        return sum(worker.index is not None for worker in self._workers)

    def _staff(self, count: int) -> None:
        """As many processes as are needed."""
        with _PROCESSES:
            self._require_not_dismissed()
            while len(self._workers) < count:
                self._workers.append(_Worker(self._work, self._limits, self._idle_s))

    def _turn(self, waiting: deque[int], tasks: Sequence[Task]) -> Iterator[tuple[int, Answer | TaskFailure]]:
        """Hand out work, wait until something happens, and answer what became of tasks."""
        for worker in self._workers:
            if worker.ready and waiting:
                index = waiting.popleft()
                worker.give(index, tasks[index])
        deadlines = [worker.deadline_s for worker in self._workers if worker.deadline_s is not None]
        patience_s = max(min(deadlines) - time.monotonic(), 0.0) if deadlines else None
        wait([worker.connection for worker in self._workers], patience_s)
        for worker in tuple(self._workers):
            at, answer = worker.index, worker.listen()
            if isinstance(answer, TaskFailure):
                self._require_not_dismissed()
                self._workers.remove(worker)
                worker.require_started()
            if at is not None and answer is not None:
                yield at, answer

    def _require_not_dismissed(self) -> None:
        """The loss of a process that was dismissed is no failure of its task."""
        if self._dismissed:
            raise CancelledError("dismissed while at work")


class _Worker:
    """One process, and the task it is at."""

    def __init__(self, work: Callable[[Any], Any], limits: Limits, idle_s: float | None) -> None:
        # One thread each, or the workers' linear algebra fights for the same cores; and the same hashes everywhere.
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ.setdefault(name, "1")
        os.environ["PYTHONHASHSEED"] = "0"
        context = get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs, work, limits.rss_mb, idle_s), daemon=True)
        self._process.start()
        theirs.close()
        self._wall_s = limits.wall_s
        self.ready = self._started = False
        self.index: int | None = None
        self.deadline_s: float | None = None

    def require_started(self) -> None:
        """A process that cannot even begin would be replaced for ever."""
        if not self._started:
            raise FusionError(
                "worker processes end before they begin; in a script, call this under `if __name__ == '__main__':`, "
                "or use one worker"
            )

    def give(self, index: int, task: object) -> None:
        self.ready, self.index = False, index
        self.deadline_s = None if self._wall_s is None else time.monotonic() + self._wall_s
        with suppress(BrokenPipeError):  # it died while it had nothing to do, and `listen` will report it
            self.connection.send(task)

    def listen(self) -> Answer | TaskFailure | None:
        """Its answer or failure by now; None: neither, or that it is ready for its first task."""
        try:
            answer = self.connection.recv() if self.connection.poll() else None
        except (EOFError, OSError):
            with _PROCESSES:
                self._process.join()
                return TaskFailure.OUT_OF_MEMORY if self._process.exitcode == OUT_OF_MEMORY else TaskFailure.CRASHED
        if answer is not None:
            self._started = self.ready = True
            self.index = self.deadline_s = None
            return answer if isinstance(answer, Answer) else None
        if self.deadline_s is not None and time.monotonic() >= self.deadline_s:
            self.kill()
            return TaskFailure.TIMEOUT
        return None

    def kill(self) -> None:
        self._process.kill()
        self._process.join()
