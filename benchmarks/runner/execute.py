"""Cells carried out: an estimate each, then a score each, kept apart, so that a new metric scores old tracks again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.cell import status_of
from benchmarks.faults.faults import apply_faults, outages
from benchmarks.lane import Lane, run_lane
from benchmarks.metrics.dynamics import fault_metrics
from benchmarks.metrics.innovations import innovation_metrics
from benchmarks.metrics.instants import evaluation_instants, match
from benchmarks.metrics.interpolation import meet
from benchmarks.metrics.score import Errors, errors, metrics
from benchmarks.metrics.track import Track, from_bytes, to_bytes
from benchmarks.prior import begin_ns
from benchmarks.runner.definition import CLEAN, CellLimits
from benchmarks.runner.plan import Cell, read_faults
from benchmarks.runner.source import open_run
from benchmarks.runner.store import Store, to_json
from benchmarks.workers import Limits, Loss, compute
from logs.run import Run

LOST = {
    Loss.CRASHED: "its process died, twice; run it alone with --workers 1 to see why",
    Loss.TIMEOUT: "it took longer than limits.wall_s of the suite",
    Loss.OUT_OF_MEMORY: "it took more memory than limits.rss_mb of the suite",
}


class Done(NamedTuple):
    """One cell that has its estimate and its score, and how it ended."""

    cell: Cell
    status: str


def execute(cells: Sequence[Cell], store: Store, *, workers: int, limits: CellLimits | None) -> Iterator[Done]:
    """Carry out ``cells``; each is answered as it is done, and what is in the store already is left as it is.

    ``limits`` None: in this process when ``workers`` is 1, and without an end.
    """
    tasks = [(cell, store.folder) for cell in cells]
    bounded = None if limits is None else Limits(limits.wall_s, limits.rss_mb)
    for index, status in compute(carry_out, give_up, tasks, workers, bounded):
        yield Done(cells[index], status)


def carry_out(task: tuple[Cell, Path]) -> str:
    """Make what is missing of one cell; answers its status. Raises for the run, never for the estimator."""
    cell, folder = task
    store = Store(folder)
    if not store.has("estimates", cell.estimate_key):
        run = faulty_run(cell)
        keep(cell, store, run_lane(run, cell.contestant.use, cell.contestant.params, cell.seed), len(run.measurements))
    return score(cell, store)


def give_up(task: tuple[Cell, Path], loss: Loss) -> str:
    """Keep what became of a cell whose process did not survive it: a failure is a result too."""
    cell, folder = task
    store = Store(folder)
    keep(cell, store, Lane(cell.contestant.use, (), "", 0.0, LOST[loss]), 0, ended=loss.value)
    return score(cell, store)


def faulty_run(cell: Cell) -> Run:
    """The run with the cell's faults in it, drawn by the run's id in the suite: the same for every estimator."""
    run = open_run(cell.run, cell.folder)
    if cell.fault.id == CLEAN:
        return run
    faults = read_faults(cell.fault)
    named = replace(run, name=cell.run.id)
    return apply_faults(named, faults, suite_seed=cell.suite_seed, fault_id=cell.fault.id, seed=cell.seed)


def keep(cell: Cell, store: Store, lane: Lane, measurements: int, ended: str = "crashed") -> None:
    """Put the estimate of a cell into the store."""
    result = {
        "cell": str(cell),
        "ended": ended if lane.error else "ok",
        "error": lane.error,
        "digest": lane.digest,
        "measurements": measurements,
        "fates": lane.fates.counts,
        "nis_mean": lane.fates.nis_mean,
    }
    store.write(
        "estimates", cell.estimate_key, {"result.json": to_json(result), "track.npz": to_bytes(lane.track, lane.fates)}
    )


def score(cell: Cell, store: Store) -> str:
    """Judge the estimate in the store, unless that was done; answers the status."""
    if not store.has("scores", cell.score_key):
        made = store.read_json("estimates", cell.estimate_key, "result.json")
        track, fates = from_bytes(store.read("estimates", cell.estimate_key, "track.npz"))
        measured = _metrics(cell, track)
        said = (measured.get("availability", math.nan), measured.get("pos_p50", math.nan))
        status = made["ended"] if made["error"] else status_of(track, *said)
        measured |= innovation_metrics(fates)
        found = {"status": status, "metrics": {key: _finite(value) for key, value in measured.items()}}
        store.write("scores", cell.score_key, {"result.json": to_json(found)})
    return str(store.read_json("scores", cell.score_key, "result.json")["status"])


def _metrics(cell: Cell, track: Track) -> dict[str, float]:
    """Empty without truth."""
    run = open_run(cell.run, cell.folder)
    if run.truth is None or len(run.truth) == 0:
        return {}
    rules = cell.evaluation
    if rules.reading == "interp":
        met = meet(run.truth, track, gap_s=rules.gap_s)
        measured = errors(met.instants, met.answers, met.weight)
        return {**metrics(measured), **_of_faults(cell, run, measured), "availability": met.availability}
    instants = evaluation_instants(run.truth, hz=rules.hz, gap_s=rules.gap_s)
    measured = errors(instants, match(instants, track, max_age_s=rules.max_age_s))
    return {**metrics(measured), **_of_faults(cell, run, measured)}


def _of_faults(cell: Cell, run: Run, measured: Errors) -> dict[str, float]:
    """How the cell did while its faults lasted, and after; empty without faults."""
    if cell.fault.id == CLEAN:
        return {}
    return fault_metrics(measured, begin_ns(run.measurements), outages(read_faults(cell.fault)))


def _finite(value: float) -> float | str | None:
    """JSON knows neither infinity nor NaN; here infinity means "most is lost", NaN "nothing to say"."""
    if math.isnan(value):
        return None
    return "inf" if math.isinf(value) else value


def read_metrics(stored: dict[str, Any]) -> dict[str, float]:
    """Metrics as `score` wrote them, as numbers again."""
    return {key: math.nan if value is None else float(value) for key, value in stored["metrics"].items()}
