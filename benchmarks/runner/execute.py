"""Cells carried out: an estimate each, then a score each, kept apart, so that a new metric scores old tracks again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

from benchmarks.cell import ALIVE, Outcome, outcome_of
from benchmarks.faults.inject import apply_faults
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.innovations import innovation_metrics
from benchmarks.review.frame import Frame
from benchmarks.runner.archive import from_bytes, to_bytes
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from benchmarks.runner.judge import judge, metrics_if_lost
from benchmarks.runner.plan import Cell, has_estimate, read_faults
from benchmarks.runner.reference import reference_of
from benchmarks.runner.run_source import open_run
from benchmarks.runner.store import Store, to_json
from benchmarks.runner.suite import CLEAN
from benchmarks.runner.workers import Limits, TaskFailure, compute
from logs.run import Run

LOST = {
    TaskFailure.CRASHED: "its process died, twice; `fusion bench replay` runs it alone, to see why",
    TaskFailure.TIMEOUT: "it took longer than limits.wall_s of the suite",
    TaskFailure.OUT_OF_MEMORY: "it took more memory than limits.rss_mb of the suite",
}

BROKEN = {TaskFailure.TIMEOUT.value: "wall_s", TaskFailure.OUT_OF_MEMORY.value: "rss_mb"}
"""The limit behind each loss that a greater one may spare."""


class Done(NamedTuple):
    """One cell that has its estimate and its score, and how it ended."""

    cell: Cell
    status: str


def execute(cells: Sequence[Cell], store: Store, *, workers: int, limits: Limits | None) -> Iterator[Done]:
    """Carry out ``cells``; each is answered as it is done, and what is in the store already is left as it is.

    ``limits`` None: in this process when ``workers`` is 1, and without an end.
    """
    tasks = [(cell, store.folder) for cell in cells]
    for index, status in compute(carry_out, give_up, tasks, workers, limits):
        yield Done(cells[index], status)


def carry_out(task: tuple[Cell, Path]) -> str:
    """Make what is missing of one cell; answers its status. Raises for the run, never for the estimator."""
    cell, folder = task
    store = Store(folder)
    if not has_estimate(cell, store):
        _forget(cell, store)
        run = faulty_run(cell)
        keep(cell, store, fold(cell, run), run)
    return score(cell, store)


def give_up(task: tuple[Cell, Path], loss: TaskFailure) -> str:
    """Keep what became of a cell whose process did not survive it: a failure is a result too."""
    cell, folder = task
    store = Store(folder)
    if not has_estimate(cell, store):
        _forget(cell, store)
    keep(cell, store, EstimatorRun(cell.estimator.use, (), "", 0.0, LOST[loss]), None, ended=loss.value)
    return score(cell, store)


def _forget(cell: Cell, store: Store) -> None:
    """Take away what became of a cell under a lesser limit."""
    store.discard("scores", cell.score_key)
    store.discard("estimates", cell.estimate_key)


def fold(cell: Cell, run: Run) -> EstimatorRun:
    """What the estimator of a cell makes of its run, faults and all."""
    return run_estimator(run, cell.estimator.use, cell.estimator.params, cell.seed)


def faulty_run(cell: Cell) -> Run:
    """The run with the cell's faults in it, drawn by the run's id in the suite: the same for every estimator."""
    run = open_run(cell.run, cell.folder)
    if cell.fault.id == CLEAN:
        return run
    faults = read_faults(cell.fault)
    named = replace(run, name=cell.run.id)
    return apply_faults(named, faults, suite_seed=cell.suite_seed, fault_id=cell.fault.id, seed=cell.seed)


def keep(cell: Cell, store: Store, estimator_run: EstimatorRun, run: Run | None, ended: str = "crashed") -> None:
    """Put the estimate of a cell into the store; ``run`` None: it was lost with its process."""
    result = {
        "cell": str(cell),
        "ended": ended if estimator_run.error else "ok",
        "error": estimator_run.error,
        "digest": estimator_run.digest,
        "measurements": 0 if run is None else len(run.measurements),
        "warnings": [] if run is None else list(run.warnings),
        "start_ns": None if run is None else Frame.around(run).start_ns,
        "fates": estimator_run.fates.counts,
        "nis_mean": estimator_run.fates.nis_mean,
        **_broken_limit(cell, ended),
    }
    store.write(
        "estimates",
        cell.estimate_key,
        {"result.json": to_json(result), "track.npz": to_bytes(estimator_run.track, estimator_run.fates)},
    )


def _broken_limit(cell: Cell, ended: str) -> dict[str, object]:
    """Which limit of its suite ended the cell, and how much that was; nothing of one that ended by itself."""
    name = BROKEN.get(ended)
    return {} if name is None else {"broken_limit": {"name": name, "value": getattr(cell.limits, name)}}


def stored_track(cell: Cell, store: Store) -> tuple[Track, FateColumns]:
    """What the estimator said and what became of its readings; raises `FusionError` when that is damaged."""
    place = ("estimates", cell.estimate_key, "track.npz")
    try:
        return from_bytes(store.read(*place))
    except (ValueError, KeyError, EOFError, BadZipFile) as error:
        raise store.damaged(*place, error) from error


def score(cell: Cell, store: Store) -> str:
    """Judge the estimate in the store, unless that was done; answers the status."""
    if store.has("scores", cell.score_key):
        return str(store.read_json("scores", cell.score_key, "result.json")["status"])
    made = store.read_json("estimates", cell.estimate_key, "result.json")
    track, fates = stored_track(cell, store)
    reference = reference_of(cell, store)
    judged = judge(cell, track, reference)
    available = math.nan if judged is None else judged.metrics["availability"]
    ended = Outcome(str(made["ended"]), made["error"]) if made["error"] else outcome_of(track, available)
    measured, worst_at_s = {} if judged is None else judged.metrics, None
    if judged is not None and ended.status in ALIVE:
        worst_at_s = judged.worst_at_s(made.get("start_ns"))
    elif judged is not None:
        measured = metrics_if_lost(cell, reference, judged)
    numbers = {**measured, **({} if track.flaw else innovation_metrics(fates))}
    found = {**ended._asdict(), "metrics": {key: _finite(value) for key, value in numbers.items()}}
    store.write("scores", cell.score_key, {"result.json": to_json({**found, "worst_at_s": worst_at_s})})
    return ended.status


def _finite(value: float) -> float | str | None:
    """JSON knows neither infinity nor NaN; here infinity means "most is lost", NaN "nothing to say"."""
    if math.isnan(value):
        return None
    return "inf" if math.isinf(value) else value


def read_metrics(stored: dict[str, Any]) -> dict[str, float]:
    """Metrics as `score` wrote them, as numbers again."""
    return {key: math.nan if value is None else float(value) for key, value in stored["metrics"].items()}
