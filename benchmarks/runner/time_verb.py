"""``fusion bench time``: what each estimator costs, measured alone on the machine, best of several, never cached."""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.arguments import at_least_one
from benchmarks.lane import run_lane
from benchmarks.output import write_json
from benchmarks.runner.definition import Suite, load_suite
from benchmarks.runner.plan_verb import suite_options
from benchmarks.runner.source import open_run
from benchmarks.sheet import Sheet, print_sheets

REPEATS = 5
TIMING_FILE = "timing.json"


class Timing(NamedTuple):
    """Processor time of one contestant per measurement [µs]: the least of all repeats, and their quartiles."""

    contestant: str
    least_us: float
    low_us: float
    high_us: float


def measure(suite: Suite, repeats: int = REPEATS) -> Iterator[Timing]:
    """Every contestant on the suite's first run, after one run to warm up; those that fail are left out."""
    run = open_run(suite.runs[0], suite.folder)
    for contestant in suite.contestants:
        lanes = [run_lane(run, contestant.use, contestant.params) for _ in range(repeats + 1)][1:]
        if not any(lane.error for lane in lanes):
            costs_us = [1e6 * lane.cpu_s / len(run.measurements) for lane in lanes]
            yield Timing(contestant.id, min(costs_us), *np.quantile(costs_us, [0.25, 0.75]).tolist())


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
        (timing.contestant, f"{timing.least_us:.1f}", f"{timing.low_us:.1f} to {timing.high_us:.1f}")
        for timing in timings
    )
    print_sheets([Sheet("Processor time per measurement, alone on this machine", ("", "least, µs", "quartiles"), rows)])
    return 0
