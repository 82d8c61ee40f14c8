"""Stored cells computed again: the same bytes, or the store is not to be trusted."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.runner.execute import execute
from benchmarks.runner.plan import Cell
from benchmarks.runner.store import Store
from benchmarks.runner.workers import Limits, TaskFailure


def differing(cells: Sequence[Cell], store: Store, count: int, limits: Limits) -> list[Cell]:
    """The cells, of ``count`` evenly spread over the keys of those that are there, that come out differently now.

    Each within ``limits`` in a process of its own, for some hang or die. Those that broke a limit are left out: how
    far they come depends on the machine.
    """
    there = sorted((cell for cell in cells if is_pure(cell, store)), key=lambda cell: cell.estimate_key)
    sample = there[:: max(len(there) // count, 1)][:count] if count else []
    with tempfile.TemporaryDirectory(prefix="fusion-verify-") as folder:
        again = Store(Path(folder))
        done = [one.cell for one in execute(sample, again, workers=1, limits=limits)]
        return [cell for cell in done if not _same(cell, store, again)]


def is_pure(cell: Cell, store: Store) -> bool:
    """True where the cell is there, and ended by itself."""
    if not store.has("scores", cell.score_key):
        return False
    made = store.read_json("estimates", cell.estimate_key, "result.json")
    return made["ended"] not in (TaskFailure.TIMEOUT.value, TaskFailure.OUT_OF_MEMORY.value)


def _same(cell: Cell, store: Store, again: Store) -> bool:
    return all(
        store.read(kind, key, name) == again.read(kind, key, name)
        for kind, key, name in (
            ("estimates", cell.estimate_key, "result.json"),
            ("estimates", cell.estimate_key, "track.npz"),
            ("scores", cell.score_key, "result.json"),
        )
    )
