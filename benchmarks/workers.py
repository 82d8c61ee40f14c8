"""Cells over several processes, so that one that dies takes nothing with it but itself.

At most one cell per worker is under way. When a worker dies, the pool does not tell which cell killed it: each of the
few that were under way is tried once more, alone in a fresh process, and only the one that dies again has crashed.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")


def compute(
    work: Callable[[Task], Result],
    lost: Callable[[Task], Result],
    tasks: Sequence[Task],
    workers: int,
) -> Iterator[tuple[int, Result]]:
    """(index, result) of every task as it is done; ``lost`` answers for a task whose process died twice.

    One worker: in this process, in order, nothing started. What ``work`` raises is raised here.
    """
    if workers <= 1:
        yield from ((index, work(task)) for index, task in enumerate(tasks))
        return
    # One thread each, or the workers' linear algebra fights for the same cores.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    waiting = deque(range(len(tasks)))
    while waiting:
        suspects = yield from _until_broken(work, tasks, waiting, workers)
        for index in suspects:
            yield index, _alone(work, lost, tasks[index])


def _pool(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def _until_broken(
    work: Callable[[Task], Result], tasks: Sequence[Task], waiting: deque[int], workers: int
) -> Generator[tuple[int, Result], None, list[int]]:
    """Take tasks from ``waiting`` until none is left or a worker dies; answers those under way then."""
    under_way: dict[Future[Result], int] = {}
    with _pool(workers) as pool:
        try:
            while waiting or under_way:
                while waiting and len(under_way) < workers:
                    under_way[pool.submit(work, tasks[waiting[0]])] = waiting[0]
                    waiting.popleft()
                for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                    yield under_way[future], future.result()
                    del under_way[future]
        except BrokenProcessPool:
            return sorted(under_way.values())
    return []


def _alone(work: Callable[[Task], Result], lost: Callable[[Task], Result], task: Task) -> Result:
    with _pool(1) as pool:
        try:
            return pool.submit(work, task).result()
        except BrokenProcessPool:
            return lost(task)
