"""The same cells on a Dask cluster, for those who outgrow one machine: only keys come back, results go to the store.

The store must lie where every worker of the cluster can write to it. Cells are pure and stored as they are done, so
whatever a cluster loses is made up for by running again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

from benchmarks.runner.execute import Done, carry_out, give_up
from benchmarks.runner.plan import Cell
from benchmarks.runner.store import Store
from benchmarks.workers import Loss
from fusion import FusionError

RETRIES = 1
PATIENCE_S = 10.0
"""How long a scheduler may take to answer."""


def execute_on_dask(cells: Sequence[Cell], store: Store, address: str) -> Iterator[Done]:
    """Carry out ``cells`` on the cluster whose scheduler is at ``address``; each is answered as it is done.

    A worker that dies gives its cells back; one that dies of the same cell again loses that cell alone. Raises
    `FusionError` without the package, or when nobody answers.
    """
    dask = _distributed()
    folder = store.folder.resolve()
    with _connect(dask, address) as client:
        futures = {
            client.submit(carry_out, (cell, folder), key=cell.score_key, retries=RETRIES, pure=False): cell
            for cell in cells
        }
        for future in dask.as_completed(list(futures)):
            cell = futures[future]
            try:
                status = future.result()
            except dask.KilledWorker:
                status = give_up((cell, folder), Loss.CRASHED)
            yield Done(cell, status)
            future.release()


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
