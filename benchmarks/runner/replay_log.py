"""One estimator over one run as a log: measurements in the order they came in, each followed by its estimate."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from benchmarks.metrics.estimate_track import Track
from benchmarks.runner.estimator_run import EstimatorRun
from benchmarks.runner.execute import faulty_run, fold
from benchmarks.runner.plan import Cell, cells_of
from benchmarks.runner.store import Store
from benchmarks.runner.suite import CLEAN, Suite
from fusion import SuiteError, Truth
from fusion.errors import did_you_mean
from logs.run import Run
from logs.truth import TruthTrack
from logs.writer import RunWriter


def write_replay(
    run: Run,
    estimator_run: EstimatorRun,
    output: Path,
    *,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
    **metadata: str,
) -> None:
    """A log of the messages in the order they came in, each followed by its update; from where the estimator crashed
    on, of the messages alone. Its ``metadata`` are those of the run with the certificate of the replay.
    """
    certificate = {"digest": estimator_run.digest, "estimator": estimator_run.name, "seed": str(seed)}
    certificate["parameters"] = json.dumps(dict(options or {}), sort_keys=True)
    _write(run, estimator_run, output, {**run.metadata, **certificate, **metadata})


def _write(run: Run, estimator_run: EstimatorRun, output: Path, metadata: Mapping[str, str]) -> None:
    truths = _truths(run.truth) if run.truth is not None else []
    now_ns, answered = 0, 0
    with RunWriter(output, run.world, name=run.name, prior=run.prior, metadata=metadata) as writer:
        for update, received_ns in zip(
            estimator_run.updates, Track.of(estimator_run.updates).received_ns.tolist(), strict=True
        ):
            _write_until(writer, truths, received_ns)
            # The host answers every message with one update of its own; those after it are revisions.
            if not update.revised:
                now_ns, answered = max(received_ns, 0), answered + 1
                writer.write(update.measurement, log_time_ns=now_ns)
            writer.write_update(estimator_run.name, update)
        for measurement in run.measurements[answered:]:
            now_ns = max(now_ns, measurement.time_ns)
            _write_until(writer, truths, now_ns)
            writer.write(measurement, log_time_ns=now_ns)
        _write_until(writer, truths, None)


def _write_until(writer: RunWriter, truths: list[Truth], time_ns: int | None) -> None:
    """Take the true poses up to a time, or all, off the end of ``truths``."""
    while truths and (time_ns is None or truths[-1].time_ns <= time_ns):
        writer.write_truth(truths.pop())


def _truths(track: TruthTrack) -> list[Truth]:
    """The true poses, the last one first; a heading that is not a number is not known."""
    columns = (track.time_ns.tolist(), track.x.tolist(), track.y.tolist(), track.heading.tolist())
    rows = zip(*columns, strict=True)
    return [Truth(t, x, y, None if math.isnan(heading) else heading) for t, x, y, heading in rows][::-1]


Item = TypeVar("Item")


def one_cell(suite: Suite, store: Store, run: str, estimator: str, *, fault: str = CLEAN, seed: int = 0) -> Cell:
    """The cell of a suite by the ids of what it is made of; raises `SuiteError` that names the nearest."""
    estimators = _found("estimator", estimator, {one.id: one for one in suite.estimators})
    faults = _found("fault", fault, {one.id: one for one in suite.faults})
    if not 0 <= seed < suite.seeds:
        raise SuiteError(f"{suite.name}: there is no seed {seed}; its seeds are 0 to {suite.seeds - 1}")
    return cells_of(replace(suite, runs=(suite.run(run),), estimators=estimators, faults=faults), store)[seed]


def _found(what: str, wanted: str, known: Mapping[str, Item]) -> tuple[Item]:
    if wanted not in known:
        raise SuiteError(f"the suite has no {what} {wanted!r}; {did_you_mean(wanted, known)}")
    return (known[wanted],)


def replay_cell(cell: Cell, output: Path) -> str:
    """Fold the run of ``cell``, faults and all, through its estimator; write measurements and updates as a log, and
    answer the digest: "" where the estimator crashed, which the log then shows up to that moment.
    """
    run = faulty_run(cell)
    estimator_run = fold(cell, run)
    write_replay(run, estimator_run, output, options=cell.estimator.params, seed=cell.seed, fault=cell.fault.id)
    return estimator_run.digest
