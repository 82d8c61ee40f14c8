"""``fusion bench time``: what each estimator costs in time and memory, alone on the machine, never cached."""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fusion
from benchmarks.arguments import at_least_one
from benchmarks.metrics.track import Floats
from benchmarks.output import write_json
from benchmarks.prior import starting_prior
from benchmarks.runner.definition import Contestant, RunSource, Suite, load_suite
from benchmarks.runner.plan_verb import suite_options
from benchmarks.runner.source import open_run
from benchmarks.sheet import Sheet, print_sheets
from benchmarks.worker_process import peak_rss_bytes
from benchmarks.workers import Limits, Loss, compute
from fusion.values import seconds
from logs.run import Run

REPEATS = 5
TIMING_FILE = "timing.json"


class Timing(NamedTuple):
    """What one contestant costs: processor time per measurement [µs], the least of all repeats and their quartiles;
    quantiles of the time one measurement takes [µs], in the best repeat; how many seconds of processor time a second
    of the log takes; and the peak memory [MB] of a fresh process that opens the run and filters it once, None if it
    does not survive.
    """

    contestant: str
    least_us: float
    low_us: float
    high_us: float
    upd_p50_us: float
    upd_p95_us: float
    upd_p99_us: float
    upd_max_us: float
    rtf: float
    rss_mb: float | None


def measure(suite: Suite, repeats: int = REPEATS) -> Iterator[Timing]:
    """Every contestant on the suite's first run, after one run to warm up; those that fail are left out."""
    run = open_run(suite.runs[0], suite.folder)
    stamps = [measurement.time_ns for measurement in run.measurements]
    log_s = max(seconds(max(stamps) - min(stamps)), 1e-9)
    for contestant in suite.contestants:
        try:
            folds = [_fold_us(run, contestant) for _ in range(repeats + 1)][1:]
        except Exception:  # noqa: BLE001, S112 - a plug-in may fail in any way, and has no time then
            continue
        means = [float(fold.mean()) for fold in folds]
        best = folds[int(np.argmin(means))]
        low, high = np.quantile(means, (0.25, 0.75)).tolist()
        p50, p95, p99, most = np.quantile(best, (0.50, 0.95, 0.99, 1.0)).tolist()
        rtf, rss_mb = 1e-6 * float(best.sum()) / log_s, peak_mb(suite.runs[0], suite.folder, contestant)
        yield Timing(contestant.id, min(means), low, high, p50, p95, p99, most, rtf, rss_mb)


def _fold_us(run: Run, contestant: Contestant) -> Floats:
    """How long each measurement took, (n,) [µs]."""
    built = fusion.build(contestant.use, run.world, contestant.params)
    tracker = fusion.Tracker(built, run.world, starting_prior(run))
    clock = [time.process_time_ns()]
    for measurement in run.measurements:
        tracker.push(measurement)
        clock.append(time.process_time_ns())
    return np.diff(np.array(clock)) / 1e3


def peak_mb(source: RunSource, folder: Path, contestant: Contestant) -> float | None:
    """Peak memory [MB] of a process of its own, from its start to the end of the run."""
    ((_, found),) = compute(_fold_alone, _no_peak, [(source, folder, contestant)], 1, Limits())
    return found


def _fold_alone(task: tuple[RunSource, Path, Contestant]) -> float | None:
    source, folder, contestant = task
    _fold_us(open_run(source, folder), contestant)
    return peak_rss_bytes() / 2**20


def _no_peak(_task: tuple[RunSource, Path, Contestant], _loss: Loss) -> None:
    return None


def machine() -> dict[str, str]:
    """What the figures are true of."""
    return {
        "machine": platform.machine(),
        "processor": platform.processor() or "unknown",
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def read_timing(folder: Path) -> dict[str, float]:
    """The least µs per measurement by contestant, as last measured into the store; empty when it never was."""
    path = folder / TIMING_FILE
    if not path.is_file():
        return {}
    return {row["contestant"]: row["least_us"] for row in json.loads(path.read_text(encoding="utf-8"))["timings"]}


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench time``."""
    suite_options(parser)
    parser.add_argument("--repeats", type=at_least_one, default=REPEATS, metavar="N", help="(%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Measure, keep beside the store, print."""
    timings = sorted(measure(load_suite(arguments.suite), arguments.repeats), key=lambda timing: timing.least_us)
    write_json(
        arguments.store / TIMING_FILE, {"machine": machine(), "timings": [timing._asdict() for timing in timings]}
    )
    rows = tuple(_row(timing) for timing in timings)
    head = ("µs per measurement", "least", "q25", "q75", "p50", "p95", "p99", "max", "CPU s per log s", "peak MB")
    print_sheets(
        [Sheet("Alone on this machine: processor time, means over repeats and single measurements; memory", head, rows)]
    )
    return 0


def _row(timing: Timing) -> tuple[str, ...]:
    name, *times_us, rtf, rss_mb = timing
    memory = "–" if rss_mb is None else f"{rss_mb:.0f}"
    return (str(name), *(f"{value:.1f}" for value in times_us), f"{rtf:.4f}", memory)
