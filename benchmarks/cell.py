"""One cell of a benchmark: one estimator on one log, a pure function of log, estimator, parameters and seed.

Only paths and small results cross the border between processes, never a log's content.
"""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fusion
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.innovations import innovation_metrics, nis_metrics
from benchmarks.metrics.matching import availability, match
from benchmarks.metrics.score import Errors, errors, for_json, metrics, metrics_of_lost, unanswered
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from logs.reader import read_run
from logs.run import Run
from logs.truth import evaluation_instants

LEAST_AVAILABILITY = 0.5
"""An estimator with valid answers at no more than this share of instants counts as diverged: its median is infinite."""
STATUSES = ("ok", "unscored", "diverged", "crashed")
"""What can become of a cell, best first; ``unscored``: the log holds no ground truth."""
ALIVE = ("ok", "unscored")
"""Statuses of a cell that was not lost."""


class Cell(NamedTuple):
    """What is to be computed. ``options`` are the estimator's parameters, those not given at their defaults."""

    path: Path
    estimator: str
    options: Mapping[str, object]
    seed: int


@dataclass(frozen=True)
class Score:
    """The result of one cell: see `record` for its meaning. ``error``: why it was lost. ``errors`` is None without
    truth.
    """

    run: str
    estimator: str
    status: str
    error: str | None = None
    errors: Errors | None = None
    facts: Mapping[str, object] = field(default_factory=dict)

    @cached_property
    def metrics(self) -> dict[str, float]:
        """Metrics by id (`benchmarks.metrics.score`), of one that was lost `metrics_of_lost`; empty without truth, and
        what needs none is among the facts.
        """
        if self.errors is None:
            return {}
        scores = metrics(self.errors)
        return scores if self.status in ALIVE else metrics_of_lost(scores, metrics(unanswered(self.errors.instants)))

    def record(self) -> dict[str, object]:
        """Everything as one flat table for strict JSON: metrics beside facts, in SI units.

        JSON knows neither infinity nor NaN. Both are None: read them with ``status`` (a median that is infinite
        makes it ``diverged``) and ``availability`` (below 0.75, ``pos_p75`` is infinite).
        """
        head = {"run": self.run, "estimator": self.estimator, "status": self.status, "error": self.error}
        return {**head, **for_json(self.metrics), **self.facts}


@lru_cache(maxsize=1)
def _read(path: Path, _modified_ns: int) -> Run:
    return read_run(path)


def cached_run(path: Path) -> Run:
    """The log at ``path``, kept until another is asked for or it changes; raises `LogError`."""
    return _read(path, path.stat().st_mtime_ns if path.exists() else 0)


def score_cell(cell: Cell) -> Score:
    """Run the estimator and judge it. Raises `LogError` for the log; what the estimator does is in the score."""
    run = cached_run(cell.path)
    return score_run(cell, run, run_estimator(run, cell.estimator, cell.options, cell.seed))


def score_run(cell: Cell, run: Run, estimator_run: EstimatorRun) -> Score:
    """The score of an estimator that has run."""
    measured = _errors(run, estimator_run)
    ended = _outcome(estimator_run, measured)
    answered = {} if measured is not None else for_json({"availability": availability(estimator_run.track)})
    facts = {**_facts(cell, run), **answered, **_cost(run, estimator_run)}
    return Score(run.name, cell.estimator, *ended, measured, facts)


def crashed(cell: Cell, error: str) -> Score:
    """The score of a cell whose process did not survive."""
    run = cached_run(cell.path)
    estimator_run = EstimatorRun(cell.estimator, (), "", 0.0, error)
    return Score(run.name, cell.estimator, "crashed", error, _errors(run, estimator_run), _facts(cell, run))


def _errors(run: Run, estimator_run: EstimatorRun) -> Errors | None:
    """None without truth. An estimator that crashed gave no answer at all: half a run is not a result."""
    if run.truth is None:
        return None
    instants = evaluation_instants(run.truth)
    if len(instants.time_ns) == 0:
        return None
    return errors(instants, match(instants, estimator_run.track))


class Outcome(NamedTuple):
    """How a cell ended: one of `STATUSES`, and why it was lost."""

    status: str
    error: str | None = None


def _outcome(estimator_run: EstimatorRun, measured: Errors | None) -> Outcome:
    if estimator_run.error is not None:
        return Outcome("crashed", estimator_run.error)
    return outcome_of(
        estimator_run.track, math.nan if measured is None else float(np.isfinite(measured.position).mean())
    )


def outcome_of(track: Track, availability: float) -> Outcome:
    """How an estimator that did not crash ended, from the share of instants with a valid answer; NaN without truth."""
    if track.flaw:
        return Outcome("diverged", track.flaw)
    if math.isnan(availability):
        return Outcome("unscored")
    if availability <= LEAST_AVAILABILITY:
        return Outcome("diverged", f"only {100.0 * availability:.1f} % of the instants have a valid answer")
    return Outcome("ok")


def _facts(cell: Cell, run: Run) -> dict[str, object]:
    return {
        "log": str(cell.path),
        "warnings": list(run.warnings),
        "seed": cell.seed,
        "parameters": dict(cell.options),
        "world": run.world.name,
        "world_hash": run.world.hash,
        "measurements": len(run.measurements),
        "versions": {"fusion": fusion.__version__, "numpy": np.__version__, "python": platform.python_version()},
    }


def _cost(run: Run, estimator_run: EstimatorRun) -> dict[str, object]:
    """What needs no truth: digest, processor time, and of the last word on each measurement fates and, of an estimator
    that did not diverge, innovations.
    """
    if estimator_run.error is not None:
        return {}
    sound = not estimator_run.track.flaw
    return {
        "digest": estimator_run.digest,
        "cpu_s": estimator_run.cpu_s,
        "cpu_per_measurement_s": estimator_run.cpu_s / len(run.measurements) if run.measurements else None,
        "fates": estimator_run.fates.counts,
        "nis_mean": estimator_run.fates.nis_mean if sound else None,
        **(for_json({**innovation_metrics(estimator_run.fates), **nis_metrics(estimator_run.fates)}) if sound else {}),
    }
