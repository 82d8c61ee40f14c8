"""The same cells on a Dask cluster, for those who outgrow one machine: only keys come back, results go to the store.

The store must lie where every worker of the cluster can write to it. Cells are pure and stored as they are done, so
whatever a cluster loses is made up for by running again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any
from uuid import uuid4

from benchmarks.runner.execute import Done
from benchmarks.runner.plan import Cell
from benchmarks.runner.store import Store
from benchmarks.runner.workers import Limits
from fusion import FusionError

RETRIES = 1
PATIENCE_S = 10.0
"""Time for a scheduler to answer [s]."""


def execute_on_dask(cells: Sequence[Cell], store: Store, address: str, limits: Limits) -> Iterator[Done]:
    """Carry out ``cells`` on the cluster whose scheduler is at ``address``; each is answered as it is done.

    A cell that dies or breaks ``limits`` costs itself alone. A Dask worker that dies gives its cells back; those that
    Dask gives up since too many died are no results: they stay missing, which a `FusionError` reports when the rest
    is done. Raises that also without the package, and when nobody answers (any more).
    """
    dask = _distributed()
    with _connect(dask, address) as client, _cell_processes(client, limits) as plugin:
        futures = _submit(client, plugin, cells, store)
        try:
            yield from _as_done(dask, futures)
        except CancelledError as error:
            raise FusionError(f"--dask {address}: the scheduler went away; start it, then run again") from error
        finally:
            client.cancel(list(futures))


def _as_done(dask: Any, futures: dict[Any, Cell]) -> Iterator[Done]:  # noqa: ANN401 - the package
    unfinished = []
    for future in dask.as_completed(list(futures)):
        cell = futures[future]
        try:
            carried = future.result()
        except dask.KilledWorker:
            unfinished.append(cell)
        else:
            yield Done(cell, carried)
        future.release()
    if unfinished:
        raise FusionError(
            f"cells that are not done: {len(unfinished)}, one of them {unfinished[0]}; one Dask worker after the other "
            "died with them; see the workers' logs (out of memory? lower limits.rss_mb of the suite), then run again"
        )


@contextmanager
def _cell_processes(client: Any, limits: Limits) -> Iterator[str]:  # noqa: ANN401 - a client
    """Processes for the cells of this run on every worker that is there or comes later; answers their plugin's name."""
    from benchmarks.runner.dask_worker import CellProcesses

    name = f"fusion-bench-{uuid4()}"
    client.register_plugin(CellProcesses(limits), name)
    try:
        yield name
    finally:
        with suppress(OSError):  # a cluster that is gone has taken them with it
            client.unregister_worker_plugin(name)


def _submit(client: Any, plugin: str, cells: Sequence[Cell], store: Store) -> dict[Any, Cell]:  # noqa: ANN401
    """A future for each cell. Another run on the same cluster may have the same cells, but not the same processes."""
    from benchmarks.runner.dask_worker import carry_out_here

    folder = store.folder.resolve()
    return {
        client.submit(
            carry_out_here, plugin, (cell, folder), key=f"{plugin}-{cell.score_key}", retries=RETRIES, pure=False
        ): cell
        for cell in cells
    }


def _distributed() -> Any:  # noqa: ANN401 - an optional package, much of it without annotations
    try:
        return import_module("distributed")
    except ImportError as error:
        raise FusionError("--dask needs Dask distributed; pip install 'fusion-localization[cluster]'") from error


def _connect(dask: Any, address: str) -> Any:  # noqa: ANN401 - a client
    try:
        return dask.Client(address, timeout=PATIENCE_S)
    except (OSError, ValueError) as error:
        remedy = "start one with `dask scheduler`"
        raise FusionError(f"--dask {address}: no scheduler answers ({error}); {remedy}") from error
