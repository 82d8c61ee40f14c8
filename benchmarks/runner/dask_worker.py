"""Cells on a Dask worker: carried out as on one machine, in a process that the suite's limits hold for.

A cell that hangs, crashes or eats memory so costs its own process alone, and the Dask worker takes the next one. Needs
the package of Dask; `benchmarks.runner.dask_cluster` imports this where that is there.
"""

from __future__ import annotations

from concurrent.futures import CancelledError
from multiprocessing import current_process
from pathlib import Path
from queue import LifoQueue

from distributed import Reschedule, Worker, WorkerPlugin, get_worker

from benchmarks.runner.execute import Carried, carry_out, give_up
from benchmarks.runner.plan import Cell
from benchmarks.runner.workers import Limits, WorkerPool

Task = tuple[Cell, Path]
IDLE_S = 60.0
"""A process without a cell for that long ends: its run may have been killed without dismissing it."""


class CellProcesses(WorkerPlugin):
    """The processes of one run on one Dask worker: one per thread, kept from cell to cell until the run or it ends."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits

    def setup(self, worker: Worker) -> None:
        """Make ready; a process is started when there is a cell for it."""
        # The workers of a Dask nanny are daemons, which the standard library lets have no children, lest they be left
        # behind. Ours end with their parent.
        current_process().daemon = False
        self._pools = [WorkerPool(carry_out, give_up, self._limits, IDLE_S) for _ in range(worker.state.nthreads)]
        self._free: LifoQueue[WorkerPool[Task, Carried]] = LifoQueue()
        for pool in self._pools:
            self._free.put(pool)

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002 - Dask's signature
        """End the processes, in the middle of a cell if need be."""
        for pool in self._pools:
            pool.dismiss()

    def carry_out(self, task: Task) -> Carried:
        """Make what is missing of one cell within the limits. Raises `CancelledError`."""
        pool = self._free.get()
        try:
            ((_, carried),) = pool.compute([task], workers=1)
        finally:
            self._free.put(pool)
        return carried


def carry_out_here(plugin: str, task: Task) -> Carried:
    """One cell on the Dask worker that this runs on, in the processes of the `CellProcesses` of that name.

    A worker that is closing ends them; the cell is then somebody else's.
    """
    processes = get_worker().plugins.get(plugin)
    if not isinstance(processes, CellProcesses):
        raise Reschedule
    try:
        return processes.carry_out(task)
    except CancelledError:
        raise Reschedule from None
