"""Processor time and memory of each estimator, alone on the machine, never cached."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

import fusion
from benchmarks.runner.execute import LOST
from benchmarks.runner.run_source import open_run
from benchmarks.runner.suite import EstimatorSpec, RunSource, Suite
from benchmarks.runner.worker_process import peak_rss_bytes
from benchmarks.runner.workers import Limits, TaskFailure, compute
from fusion import FusionError
from fusion.arrays import Floats
from fusion.values import seconds
from logs.prior import starting_prior
from logs.run import Run

REPEATS = 5


TIMING_FILE = "timing.json"


TimingTask: TypeAlias = tuple[RunSource, Path, EstimatorSpec, int]
"""A run, the folder of its suite, an estimator, and how many repeats."""


class Timing(NamedTuple):
    """Cost of one estimator: processor time per measurement [µs], the least of all repeats and their quartiles;
    quantiles of the time one measurement takes [µs], in the best repeat; how many seconds of processor time a second
    of the log takes; and the peak memory [MB] of a fresh process that opens the run and filters it once.
    """

    estimator: str
    least_us: float
    low_us: float
    high_us: float
    upd_p50_us: float
    upd_p95_us: float
    upd_p99_us: float
    upd_max_us: float
    rtf: float
    rss_mb: float


class Untimed(NamedTuple):
    """An estimator that has no time, and why."""

    estimator: str
    why: str


def measure(suite: Suite, repeats: int = REPEATS) -> Iterator[Timing | Untimed]:
    """Every estimator on the suite's first run, after one run to warm up, in a process of its own within the suite's
    limits: one that fails, hangs or dies costs its own time alone.
    """
    tasks = [(suite.runs[0], suite.folder, estimator, repeats) for estimator in suite.estimators]
    limits = Limits(suite.limits.wall_s * (repeats + 1), suite.limits.rss_mb)
    for task in tasks:
        ((_, timing),) = compute(_time, _untimed, [task], 1, limits)
        yield timing


def _untimed(task: TimingTask, loss: TaskFailure) -> Timing | Untimed:
    return Untimed(task[2].id, LOST[loss])


def _time(task: TimingTask) -> Timing | Untimed:
    source, folder, estimator, repeats = task
    run = open_run(source, folder)
    stamps = [measurement.time_ns for measurement in run.measurements]
    if not stamps:
        return Untimed(estimator.id, f"{source.id} holds no measurement")
    try:
        _fold_us(run, estimator)
        rss_mb = peak_rss_bytes() / 2**20
        folds = [_fold_us(run, estimator) for _ in range(repeats)]
    except Exception as error:  # noqa: BLE001 - a plug-in may fail in any way, and has no time then
        return Untimed(estimator.id, str(error) if isinstance(error, FusionError) else repr(error))
    return _timing(estimator.id, folds, max(seconds(max(stamps) - min(stamps)), 1e-9), rss_mb)


def _timing(name: str, folds: Sequence[Floats], log_s: float, rss_mb: float) -> Timing:
    means = [float(fold.mean()) for fold in folds]
    best = folds[int(np.argmin(means))]
    low, high = np.quantile(means, (0.25, 0.75)).tolist()
    p50, p95, p99, most = np.quantile(best, (0.50, 0.95, 0.99, 1.0)).tolist()
    return Timing(name, min(means), low, high, p50, p95, p99, most, 1e-6 * float(best.sum()) / log_s, rss_mb)


def _fold_us(run: Run, estimator: EstimatorSpec) -> Floats:
    """Processor time of each measurement, (n,) [µs]."""
    built = fusion.build(estimator.use, run.world, estimator.params)
    tracker = fusion.Tracker(built, run.world, starting_prior(run))
    clock = [time.process_time_ns()]
    for measurement in run.measurements:
        tracker.push(measurement)
        clock.append(time.process_time_ns())
    return np.diff(np.array(clock)) / 1e3


def machine() -> dict[str, str]:
    """Machine and versions that the figures hold for."""
    return {
        "machine": platform.machine(),
        "processor": platform.processor() or "unknown",
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def read_timing(folder: Path) -> dict[str, float]:
    """The least µs per measurement by estimator, as last measured into the store; empty when it never was."""
    path = folder / TIMING_FILE
    if not path.is_file():
        return {}
    return {row["estimator"]: row["least_us"] for row in json.loads(path.read_text(encoding="utf-8"))["timings"]}
