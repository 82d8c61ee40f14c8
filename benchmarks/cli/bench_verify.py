"""``fusion bench verify``: compute a sample of the stored cells again, and see whether they are what they were."""

from __future__ import annotations

import argparse
import sys

from benchmarks.cli.suite_arguments import opened, suite_options
from benchmarks.runner.gate import Outcome
from benchmarks.runner.plan import cells_of
from benchmarks.runner.verify import differing, is_pure
from benchmarks.runner.workers import Limits
from fusion.cli.arguments import at_least_one


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench verify``."""
    suite_options(parser)
    parser.add_argument("--sample", type=at_least_one, default=10, metavar="N", help="how many cells (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Name the cells that differ. Exit code 5 when some do, 3 when none is there to compare."""
    suite, store = opened(arguments)
    cells = cells_of(suite, store)
    if not any(is_pure(cell, store) for cell in cells):
        sys.stderr.write("fusion bench verify: no cell is there that ended by itself; run the suite first\n")
        return Outcome.NOT_MEASURED
    wrong = differing(cells, store, arguments.sample, Limits(suite.limits.wall_s, suite.limits.rss_mb))
    for cell in wrong:
        sys.stdout.write(f"{cell}: computed again, it differs\n")
    if not wrong:
        sys.stdout.write("computed again, every sampled cell is the same to the bit\n")
    return Outcome.NOT_DETERMINISTIC if wrong else 0
