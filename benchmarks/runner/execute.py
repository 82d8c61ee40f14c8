"""Cells carried out: an estimate each, then a score each, kept apart, so that a new metric scores old tracks again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

from benchmarks.faults.inject import apply_faults
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.fates import FateColumns
from benchmarks.runner.archive import from_bytes, to_bytes
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from benchmarks.runner.plan import Cell, has_estimate, read_faults
from benchmarks.runner.reference import Reference, reference_of
from benchmarks.runner.run_source import open_run
from benchmarks.runner.scoring import End, Score, score
from benchmarks.runner.store import Store, to_json
from benchmarks.runner.suite import CLEAN
from benchmarks.runner.workers import Limits, TaskFailure, compute
from fusion.values import seconds
from logs.run import Run

LOST = {
    TaskFailure.CRASHED: "its process died, twice; `fusion replay`, or of a suite `fusion bench replay`, runs it alone",
    TaskFailure.TIMEOUT: "it took longer than limits.wall_s of the suite",
    TaskFailure.OUT_OF_MEMORY: "it took more memory than limits.rss_mb of the suite",
}

BROKEN = {TaskFailure.TIMEOUT.value: "wall_s", TaskFailure.OUT_OF_MEMORY.value: "rss_mb"}
"""The limit behind each loss that a greater one may spare."""


class Carried(NamedTuple):
    """A cell carried out: its status, and the processor time of its fold [s], None where that was done before."""

    status: str
    cpu_s: float | None = None


class Done(NamedTuple):
    """One cell that has its estimate and its score."""

    cell: Cell
    carried: Carried


def execute(cells: Sequence[Cell], store: Store, *, workers: int, limits: Limits | None) -> Iterator[Done]:
    """Carry out ``cells``; each is answered as it is done, and what is in the store already is left as it is.

    ``limits`` None: in this process when ``workers`` is 1, and without an end.
    """
    tasks = [(cell, store.folder) for cell in cells]
    for index, carried in compute(carry_out, give_up, tasks, workers, limits):
        yield Done(cells[index], carried)


def carry_out(task: tuple[Cell, Path]) -> Carried:
    """Make what is missing of one cell. Raises for the run, never for the estimator."""
    cell, folder = task
    store, cpu_s = Store(folder), None
    if not has_estimate(cell, store):
        _forget(cell, store)
        run = faulty_run(cell)
        made = fold(cell, run)
        cpu_s = None if made.error else made.cpu_s
        keep(cell, store, made, run)
    return Carried(keep_score(cell, store), cpu_s)


def give_up(task: tuple[Cell, Path], loss: TaskFailure) -> Carried:
    """Keep the failure of a cell whose process did not survive it: that is a result too."""
    cell, folder = task
    store = Store(folder)
    if not has_estimate(cell, store):
        _forget(cell, store)
    keep(cell, store, EstimatorRun(cell.estimator.use, error=LOST[loss]), None, ended=loss.value)
    return Carried(keep_score(cell, store))


def _forget(cell: Cell, store: Store) -> None:
    """Discard the result of a cell under a lesser limit."""
    store.discard("scores", cell.score_key)
    store.discard("estimates", cell.estimate_key)


def fold(cell: Cell, run: Run) -> EstimatorRun:
    """Run the estimator of a cell over its run, faults and all."""
    return run_estimator(run, cell.estimator.use, cell.estimator.params, cell.seed)


def faulty_run(cell: Cell) -> Run:
    """The run with the cell's faults in it, drawn by the run's id in the suite: the same for every estimator."""
    run = open_run(cell.run, cell.folder)
    if cell.fault.id == CLEAN:
        return run
    faults = read_faults(cell.fault)
    named = replace(run, name=cell.run.id)
    return apply_faults(named, faults, suite_seed=cell.suite_seed, fault_id=cell.fault.id, seed=cell.seed)


def keep(cell: Cell, store: Store, made: EstimatorRun, run: Run | None, ended: str = "crashed") -> None:
    """Put the estimate of a cell into the store; ``run`` None: it was lost with its process."""
    about = {
        "measurements": None if run is None else len(run.measurements),
        "warnings": [] if run is None else list(run.warnings),
        "world": None if run is None else run.world.name,
        "world_hash": None if run is None else run.world.hash,
    }
    ending = {"ended": ended if made.error else "ok", "error": made.error, **_broken_limit(cell, ended)}
    result = {"cell": str(cell), **ending, "digest": made.digest, "fates": made.fates.counts, **about}
    files = {"result.json": to_json(result), "track.npz": to_bytes(made.track, made.fates)}
    store.write("estimates", cell.estimate_key, files)


def _broken_limit(cell: Cell, ended: str) -> dict[str, object]:
    """The limit of its suite that ended the cell, and its value; nothing of a cell that ended by itself."""
    name = BROKEN.get(ended)
    return {} if name is None else {"broken_limit": {"name": name, "value": getattr(cell.limits, name)}}


def stored_track(cell: Cell, store: Store) -> tuple[Track, FateColumns]:
    """The estimates of a cell and the fates of its readings; raises `FusionError` where they are damaged."""
    place = ("estimates", cell.estimate_key, "track.npz")
    try:
        return from_bytes(store.read(*place))
    except (ValueError, KeyError, EOFError, BadZipFile) as error:
        raise store.damaged(*place, error) from error


def keep_score(cell: Cell, store: Store) -> str:
    """Score the estimate in the store, unless that was done; answers the status."""
    if store.has("scores", cell.score_key):
        return str(store.read_json("scores", cell.score_key, "result.json")["status"])
    made = store.read_json("estimates", cell.estimate_key, "result.json")
    reference = reference_of(cell, store)
    scored = _score(cell, store, reference, made)
    worst_at_s = None if scored.worst_at_ns is None else seconds(scored.worst_at_ns - reference.begin_ns)
    numbers = {key: _finite(value) for key, value in scored.metrics.items()}
    result = {**scored.end._asdict(), "metrics": numbers, "worst_at_s": worst_at_s}
    store.write("scores", cell.score_key, {"result.json": to_json(result)})
    return scored.status


def _score(cell: Cell, store: Store, reference: Reference, made: dict[str, Any]) -> Score:
    return score(
        *stored_track(cell, store),
        reference,
        crash=End(str(made["ended"]), made["error"]) if made["error"] else None,
        rules=cell.evaluation,
        faults=read_faults(cell.fault),
    )


def _finite(value: float) -> float | str | None:
    """JSON knows neither infinity nor NaN; here infinity means "most is lost", NaN "undefined"."""
    if math.isnan(value):
        return None
    return "inf" if math.isinf(value) else value


def read_metrics(stored: dict[str, Any]) -> dict[str, float]:
    """Metrics as `keep_score` wrote them, as numbers again."""
    return {key: math.nan if value is None else float(value) for key, value in stored["metrics"].items()}
