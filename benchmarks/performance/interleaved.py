"""Processor time of several jobs in one process, in turn, so that a slow moment of the machine meets all of them."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple, TypeVar

from benchmarks.performance.drive import STEPS_PER_SCAN, Drive
from benchmarks.performance.implementation import Implementation

Key = TypeVar("Key", bound=Hashable)

Job = Callable[[], Iterable[float]]
"""Does some work, and answers one cost or several of it, always as many."""


class Cost(NamedTuple):
    """A cost over all rounds, in any unit. The least is the figure; a median far above shows a noisy machine."""

    least: float
    median: float

    @classmethod
    def of(cls, rounds: Iterable[float]) -> Cost:
        """Of the same cost in several rounds."""
        costs = list(rounds)
        return cls(min(costs), statistics.median(costs))

    def times(self, factor: float) -> Cost:
        """In another unit."""
        return Cost(self.least * factor, self.median * factor)


def interleaved(jobs: Mapping[Key, Job], rounds: int, *, warm_up: bool = True) -> dict[Key, tuple[Cost, ...]]:
    """The costs of every job in ``rounds``, each job once in each. ``warm_up``: one round before these does not count;
    processes of their own need none.
    """
    found: dict[Key, list[tuple[float, ...]]] = {key: [] for key in jobs}
    for number in range(rounds + warm_up):
        for key, job in jobs.items():
            with _without_collection():
                costs = tuple(job())
            if number >= warm_up:
                found[key].append(costs)
    return {key: tuple(Cost.of(costs) for costs in zip(*each, strict=True)) for key, each in found.items()}


def cpu_s(work: Callable[[], object]) -> float:
    """Processor time of this process that ``work`` takes [s]."""
    started_s = time.process_time()
    work()
    return time.process_time() - started_s


def live_job(implementation: Implementation, driven: Drive) -> Job:
    """Costs of a filter on a drive [s]: of one odometry step, of one scan, and of both in proportion, per step."""
    blocks = implementation.blocks(driven)

    def job() -> tuple[float, float, float]:
        made, clock = implementation.start(driven), time.process_time_ns
        steps_ns = scans_ns = 0
        for steps, scan in blocks:
            started_ns = clock()
            made.move(steps)
            moved_ns = clock()
            made.update(scan)
            steps_ns += moved_ns - started_ns
            scans_ns += clock() - moved_ns
        step_s = 1e-9 * steps_ns / (len(blocks) * STEPS_PER_SCAN)
        scan_s = 1e-9 * scans_ns / len(blocks)
        return step_s, scan_s, step_s + scan_s / STEPS_PER_SCAN

    return job


@contextmanager
def _without_collection() -> Iterator[None]:
    """Garbage is collected between the jobs, so that no job pays for another's."""
    gc.collect()
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
