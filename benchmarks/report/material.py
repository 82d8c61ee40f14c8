"""What a report is made of: the results of a suite, and for its figures the errors of the clean cells of one seed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.archive import from_bytes
from benchmarks.metrics.instants import Answers, Instants, evaluation_instants, match
from benchmarks.metrics.track import Floats
from benchmarks.runner.definition import CLEAN, Suite
from benchmarks.runner.results import RANKED_BY, Result, by_contestant, comparison, median_metrics
from benchmarks.runner.source import open_run
from benchmarks.runner.store import Store
from benchmarks.runner.time_verb import read_timing
from benchmarks.statistics.verdict import Comparison
from fusion import ParameterError
from fusion.values import seconds
from logs.run import Run

SHOWN_RUNS = 6
"""Runs that get panels of their own."""


class Series(NamedTuple):
    """One cell over its run: ``time_s`` from the first instant, position error [m], infinite without a valid answer."""

    result: Result
    instants: Instants
    answers: Answers

    @property
    def time_s(self) -> Floats:
        """Since the first instant."""
        return np.array([seconds(int(time_ns - self.instants.time_ns[0])) for time_ns in self.instants.time_ns])

    @property
    def error_m(self) -> Floats:
        """Horizontal distances."""
        away = np.hypot(self.answers.x - self.instants.x, self.answers.y - self.instants.y)
        return np.where(self.answers.valid, away, np.inf)


class Material:
    """A suite, its results, and what follows from them; everything is computed when first asked for."""

    def __init__(self, suite: Suite, results: Sequence[Result], store: Store, metric: str = RANKED_BY) -> None:
        self.suite, self.results, self.metric = suite, list(results), metric
        self._store = store

    @cached_property
    def contestants(self) -> list[str]:
        """The best first."""
        grouped = by_contestant(self.results)
        return sorted(grouped, key=lambda name: (median_metrics(grouped[name]).get(self.metric, np.inf), name))

    @cached_property
    def comparison(self) -> Comparison | None:
        """All pairs; None where nothing can be compared, such as runs without truth."""
        if len(self.contestants) < 2:
            return None
        try:
            return comparison(self.results, self.metric)
        except ParameterError:
            return None

    @cached_property
    def timing(self) -> dict[str, float]:
        """µs per measurement by contestant, empty when it was never measured."""
        return read_timing(self._store.folder)

    @cached_property
    def scored_runs(self) -> list[str]:
        """The first runs that have truth."""
        known = {result.cell.run.id for result in self.results if result.metrics}
        return [run.id for run in self.suite.runs if run.id in known][:SHOWN_RUNS]

    @cached_property
    def series(self) -> dict[tuple[str, str], Series]:
        """Clean cells of the first seed, by run and contestant, of the runs that are shown."""
        found = {}
        for result in self.results:
            cell = result.cell
            if cell.fault.id == CLEAN and cell.seed == 0 and cell.run.id in self.scored_runs:
                found[cell.run.id, cell.contestant.id] = self._series(result)
        return found

    def run(self, run_id: str) -> Run:
        """The run itself, for its map."""
        return open_run(self.suite.run(run_id), self.suite.folder)

    def _series(self, result: Result) -> Series:
        cell, rules = result.cell, result.cell.evaluation
        truth = self.run(cell.run.id).truth
        assert truth is not None
        instants = evaluation_instants(truth, hz=rules.hz, gap_s=rules.gap_s)
        track, _ = from_bytes(self._store.read("estimates", cell.estimate_key, "track.npz"))
        return Series(result, instants, match(instants, track, max_age_s=rules.max_age_s))
