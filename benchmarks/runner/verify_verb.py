"""``fusion bench verify``: compute a sample of the stored cells again, and see whether they are what they were."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.arguments import at_least_one
from benchmarks.runner.execute import execute
from benchmarks.runner.plan import Cell, cells_of
from benchmarks.runner.plan_verb import opened, suite_options
from benchmarks.runner.store import Store
from benchmarks.workers import Limits, Loss

NOT_DETERMINISTIC, NOT_MEASURED = 5, 3
"""Exit codes."""


def differing(cells: Sequence[Cell], store: Store, count: int, limits: Limits) -> list[Cell]:
    """The cells, of ``count`` evenly spread over the keys of those that are there, that come out differently now.

    Each within ``limits`` in a process of its own, for some hang or die. Those that broke a limit are left out: how
    far they come depends on the machine.
    """
    there = sorted((cell for cell in cells if _is_pure(cell, store)), key=lambda cell: cell.estimate_key)
    sample = there[:: max(len(there) // count, 1)][:count] if count else []
    with tempfile.TemporaryDirectory(prefix="fusion-verify-") as folder:
        again = Store(Path(folder))
        done = [one.cell for one in execute(sample, again, workers=1, limits=limits)]
        return [cell for cell in done if not _same(cell, store, again)]


def _is_pure(cell: Cell, store: Store) -> bool:
    """Whether the cell is there, and ended by itself."""
    if not store.has("scores", cell.score_key):
        return False
    made = store.read_json("estimates", cell.estimate_key, "result.json")
    return made["ended"] not in (Loss.TIMEOUT.value, Loss.OUT_OF_MEMORY.value)


def _same(cell: Cell, store: Store, again: Store) -> bool:
    return all(
        store.read(kind, key, name) == again.read(kind, key, name)
        for kind, key, name in (
            ("estimates", cell.estimate_key, "result.json"),
            ("estimates", cell.estimate_key, "track.npz"),
            ("scores", cell.score_key, "result.json"),
        )
    )


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench verify``."""
    suite_options(parser)
    parser.add_argument("--sample", type=at_least_one, default=10, metavar="N", help="how many cells (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Name the cells that differ. Exit code 5 when some do, 3 when none is there to compare."""
    suite, store = opened(arguments)
    cells = cells_of(suite, store)
    if not any(_is_pure(cell, store) for cell in cells):
        sys.stderr.write("fusion bench verify: no cell is there that ended by itself; run the suite first\n")
        return NOT_MEASURED
    wrong = differing(cells, store, arguments.sample, Limits(suite.limits.wall_s, suite.limits.rss_mb))
    for cell in wrong:
        sys.stdout.write(f"{cell}: computed again, it differs\n")
    if not wrong:
        sys.stdout.write("computed again, every sampled cell is the same to the bit\n")
    return NOT_DETERMINISTIC if wrong else 0
