"""``fusion bench time``: what each estimator costs, measured alone on the machine, best of several, never cached."""

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
from benchmarks.runner.definition import Contestant, Suite, load_suite
from benchmarks.runner.plan_verb import suite_options
from benchmarks.runner.source import open_run
from benchmarks.sheet import Sheet, print_sheets
from fusion.values import seconds
from logs.run import Run

REPEATS = 5
TIMING_FILE = "timing.json"


class Timing(NamedTuple):
    """What one contestant costs: processor time per measurement [µs], the least of all repeats and their quartiles;
    quantiles of the time one measurement takes [µs], in the best repeat; and how many seconds of processor time a
    second of the log takes.
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
        yield Timing(contestant.id, min(means), low, high, p50, p95, p99, most, 1e-6 * float(best.sum()) / log_s)


def _fold_us(run: Run, contestant: Contestant) -> Floats:
    """How long each measurement took, (n,) [µs]."""
    built = fusion.build(contestant.use, run.world, contestant.params)
    tracker = fusion.Tracker(built, run.world, starting_prior(run))
    clock = [time.process_time_ns()]
    for measurement in run.measurements:
        tracker.push(measurement)
        clock.append(time.process_time_ns())
    return np.diff(np.array(clock)) / 1e3


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
    rows = tuple(
        (timing.contestant, *(f"{value:.1f}" for value in timing[1:-1]), f"{timing.rtf:.4f}") for timing in timings
    )
    head = ("µs per measurement", "least", "q25", "q75", "p50", "p95", "p99", "max", "CPU s per log s")
    print_sheets([Sheet("Processor time, alone on this machine: means over repeats, single measurements", head, rows)])
    return 0
