"""A suite carried out: what is missing is computed, in processes or on a cluster, and stored."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from benchmarks.runner.execute import Done, execute
from benchmarks.runner.plan import Cell, cells_of, missing, shard
from benchmarks.runner.preflight import refuse_impossible
from benchmarks.runner.results import Result, read_results
from benchmarks.runner.store import Store
from benchmarks.runner.suite import Suite
from benchmarks.runner.workers import Limits
from fusion.output.progress import Progress


def run_suite(
    suite: Suite,
    store: Store,
    *,
    workers: int | None = None,
    part: tuple[int, int] | None = None,
    dask: str | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Compute what is missing and answer the results of the whole suite that are there then.

    ``part``: number and count of a shard, from 1. ``dask``: the address of a scheduler that carries the cells out.
    What can be refused is, before any work. The same results whatever the workers, their order, or how often it was
    interrupted.
    """
    cells = cells_of(suite, store)
    wanted = cells if part is None else shard(cells, *part)
    open_cells = missing(wanted, store)
    refuse_impossible(open_cells.estimates)
    limits = Limits(suite.limits.wall_s, suite.limits.rss_mb)
    todo = [*open_cells.estimates, *open_cells.scores]
    carry_out_cells(todo, store, limits, workers=workers, dask=dask, progress=progress)
    return read_results(cells, store)


def carry_out_cells(
    todo: Sequence[Cell],
    store: Store,
    limits: Limits | None,
    *,
    workers: int | None = None,
    dask: str | None = None,
    progress: Progress | None = None,
) -> list[Done]:
    """Carry out ``todo``; answers the cells in the order in which they were done. ``limits`` None: without an end."""
    finished = []
    for count, done in enumerate(_carried_out(todo, store, limits, workers, dask), start=1):
        if progress is not None:
            progress(count, len(todo), f"{done.cell.run.id} {done.cell.estimator.id}")
        finished.append(done)
    return finished


def _carried_out(
    todo: Sequence[Cell], store: Store, limits: Limits | None, workers: int | None, dask: str | None
) -> Iterator[Done]:
    if not todo:
        return iter(())
    if dask is not None:
        from benchmarks.runner.dask_cluster import execute_on_dask

        return execute_on_dask(todo, store, dask, limits or Limits())
    count = os.cpu_count() or 1 if workers is None else workers
    return execute(todo, store, workers=min(count, len(todo)), limits=limits)
