"""``fusion bench time``: what each estimator costs in time and memory, alone on the machine, never cached."""

from __future__ import annotations

import argparse
import sys

from benchmarks.cli.suite_arguments import opened, suite_options
from benchmarks.runner.timing import REPEATS, TIMING_FILE, Timing, Untimed, machine, measure
from fusion.cli.arguments import at_least_one
from fusion.output.files import write_json
from fusion.output.tables import Table, print_tables


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench time``."""
    suite_options(parser)
    parser.add_argument("--repeats", type=at_least_one, default=REPEATS, metavar="N", help="(%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Measure, keep beside the store, print. Exit code 1 when no estimator has a time."""
    suite, store = opened(arguments)
    measured = list(measure(suite, arguments.repeats))
    timings = sorted((one for one in measured if isinstance(one, Timing)), key=lambda timing: timing.least_us)
    untimed = [one for one in measured if isinstance(one, Untimed)]
    rows = {"timings": [one._asdict() for one in timings], "untimed": [one._asdict() for one in untimed]}
    write_json(store.folder / TIMING_FILE, {"machine": machine(), **rows})
    for one in untimed:
        sys.stderr.write(f"fusion bench time: {one.estimator} has no time: {one.why}\n")
    head = ("µs per measurement", "least", "q25", "q75", "p50", "p95", "p99", "max", "CPU s per log s", "peak MB")
    title = "Alone on this machine: processor time, means over repeats and single measurements; memory"
    print_tables([Table(title, head, tuple(map(_row, timings)))])
    return 0 if timings else 1


def _row(timing: Timing) -> tuple[str, ...]:
    name, *times_us, rtf, rss_mb = timing
    return (str(name), *(f"{value:.1f}" for value in times_us), f"{rtf:.4f}", f"{rss_mb:.0f}")
