"""Tasks over several processes, one at a time in each, so that one that dies or hangs takes nothing with it but itself.

A worker that dies costs its task one more try in a fresh process; one that dies twice is lost. A task that takes too
long or too much memory is lost at once, with its process: it would do so again. What the process pools of the
standard library and of joblib lose in such a case is everything that was submitted.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from enum import Enum, unique
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Generic, NamedTuple, NoReturn, TypeVar

from fusion import FusionError

Task = TypeVar("Task")
Result = TypeVar("Result")

OUT_OF_MEMORY = 77
"""Exit code by which a worker says that its task took more memory than it may."""
WATCH_S = 0.05


class Limits(NamedTuple):
    """What one task may take; None: all there is."""

    wall_s: float | None = None
    rss_mb: float | None = None


@unique
class Loss(Enum):
    """Why a task has no result."""

    CRASHED = "crashed"
    TIMEOUT = "timeout"
    OUT_OF_MEMORY = "oom"


def compute(
    work: Callable[[Task], Result],
    lost: Callable[[Task, Loss], Result],
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
    crew = _Crew(work, limits or Limits())
    waiting, died = deque(range(len(tasks))), set[int]()
    try:
        while waiting or crew.busy:
            crew.staff(min(workers, len(waiting) + crew.busy))
            for index, answer in crew.turn(waiting, tasks):
                if not isinstance(answer, Loss):
                    yield index, answer.result()
                elif answer is Loss.CRASHED and index not in died:
                    died.add(index)
                    waiting.appendleft(index)
                else:
                    yield index, lost(tasks[index], answer)
    finally:
        crew.dismiss()


class _Answer(NamedTuple):
    """What a worker sends back: a value, or what was raised instead."""

    value: Any
    raised: BaseException | None = None

    def result(self) -> Any:  # noqa: ANN401 - whatever the work answers
        if self.raised is not None:
            raise self.raised
        return self.value


class _Crew(Generic[Task, Result]):
    """The processes at work."""

    def __init__(self, work: Callable[[Task], Result], limits: Limits) -> None:
        self._work, self._limits = work, limits
        self._workers: list[_Worker] = []

    @property
    def busy(self) -> int:
        return sum(worker.index is not None for worker in self._workers)

    def staff(self, count: int) -> None:
        """As many processes as are needed."""
        while len(self._workers) < count:
            self._workers.append(_Worker(self._work, self._limits))

    def turn(self, waiting: deque[int], tasks: Sequence[Task]) -> Iterator[tuple[int, _Answer | Loss]]:
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
            if isinstance(answer, Loss):
                self._workers.remove(worker)
                worker.require_started()
            if at is not None and answer is not None:
                yield at, answer

    def dismiss(self) -> None:
        for worker in self._workers:
            worker.kill()


class _Worker:
    """One process, and the task it is at."""

    def __init__(self, work: Callable[[Any], Any], limits: Limits) -> None:
        # One thread each, or the workers' linear algebra fights for the same cores; and no salted hashes.
        for name, value in (("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1"), ("PYTHONHASHSEED", "0")):
            os.environ.setdefault(name, value)
        context = get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, work, limits.rss_mb), daemon=True)
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
        self.connection.send(task)

    def listen(self) -> _Answer | Loss | None:
        """What it has to say now; None: nothing, or that it is ready for its first task."""
        try:
            answer = self.connection.recv() if self.connection.poll() else None
        except (EOFError, OSError):
            self._process.join()
            return Loss.OUT_OF_MEMORY if self._process.exitcode == OUT_OF_MEMORY else Loss.CRASHED
        if answer is not None:
            self._started = self.ready = True
            self.index = self.deadline_s = None
            return answer if isinstance(answer, _Answer) else None
        if self.deadline_s is not None and time.monotonic() >= self.deadline_s:
            self.kill()
            return Loss.TIMEOUT
        return None

    def kill(self) -> None:
        self._process.kill()
        self._process.join()


def _serve(connection: Connection, work: Callable[[Any], Any], rss_mb: float | None) -> None:
    """The life of a worker: say that it is ready, then answer task after task until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if rss_mb is not None:
        threading.Thread(target=_watch_memory, args=(rss_mb,), daemon=True).start()
    connection.send("ready")
    while True:
        try:
            task = connection.recv()
        except EOFError:
            return
        try:
            answer = _Answer(work(task))
        except Exception as error:  # noqa: BLE001 - it is raised where the result is asked for
            answer = _Answer(None, error)
        connection.send(answer)


def _watch_memory(rss_mb: float) -> NoReturn:
    """End the process once it has ever held more than it may."""
    while peak_rss_bytes() <= rss_mb * 2**20:
        time.sleep(WATCH_S)
    os._exit(OUT_OF_MEMORY)


def peak_rss_bytes() -> int:
    """The most memory that this process ever held. Linux's own resource usage would count what the parent held, too."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
    except (OSError, StopIteration):
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
