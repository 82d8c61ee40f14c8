"""Data of a report: the results of a suite, and for its figures the errors of the clean cells of one seed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from benchmarks.limits.fix_bound import Places, fix_error
from benchmarks.metrics.catalogue import RANKED_BY, unit_of
from benchmarks.metrics.errors import Errors, errors
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.matching import Answers, match
from benchmarks.metrics.metric import Unit
from benchmarks.runner.execute import stored_track
from benchmarks.runner.reference import reference_of
from benchmarks.runner.results import Result, by_estimator, comparison, judged, median_metrics
from benchmarks.runner.run_source import open_run
from benchmarks.runner.scoring import ALIVE
from benchmarks.runner.store import STORE, Store
from benchmarks.runner.suite import CLEAN, Suite
from benchmarks.runner.timing import read_timing
from benchmarks.statistics.verdict import Comparison
from fusion import ParameterError, Ranges
from fusion.arrays import Floats
from fusion.radio import RadioKind
from fusion.values import NANOSECONDS
from logs.run import Run
from logs.truth import Instants

SHOWN_RUNS = 6
"""Runs that get panels of their own."""


class Series(NamedTuple):
    """One cell over its run, which starts at ``start_ns``: position error [m], infinite without a valid answer."""

    result: Result
    start_ns: int
    instants: Instants
    answers: Answers
    fates: FateColumns

    @property
    def is_scored(self) -> bool:
        """True where the cell was not lost."""
        return self.result.status in ALIVE

    @property
    def time_s(self) -> Floats:
        """Of the instants since the start of the run: the ``--at`` of `fusion review`."""
        return (self.instants.time_ns - self.start_ns) / NANOSECONDS

    @property
    def error_m(self) -> Floats:
        """Horizontal distances."""
        away = np.hypot(self.answers.x - self.instants.x, self.answers.y - self.instants.y)
        return np.where(self.answers.valid, away, np.inf)


def radio_of(run: Run) -> RadioKind:
    """Kind of readings that a fix of this run is made of: ranges, where it has any."""
    return "range" if any(isinstance(measurement, Ranges) for measurement in run.measurements) else "rssi"


class ReportData:
    """A suite, its results, and what follows from them; everything is computed when first asked for."""

    def __init__(self, suite: Suite, results: Sequence[Result], store: Store, metric: str = RANKED_BY) -> None:
        self.suite, self.results, self.metric = suite, list(results), metric
        self._store = store
        self._runs: dict[str, Run] = {}

    @property
    def words(self) -> list[str]:
        """Suite and store on a command line."""
        store = self._store.folder
        return [self.suite.word, *([] if store == STORE else ["--store", str(store.resolve())])]

    def anchor(self, result: Result) -> str:
        """Anchor of the entry of a cell."""
        return self._anchors[_ids(result)]

    def use(self, estimator: str) -> str:
        """The installed name of its estimator, which has the colour."""
        return next(one.use for one in self.suite.estimators if one.id == estimator)

    def anchor_of_all(self, estimator: str) -> str:
        """Anchor of all cells of an estimator."""
        return f"all-{self.estimators.index(estimator)}"

    @cached_property
    def _anchors(self) -> dict[tuple[str, str, str, int], str]:
        return {_ids(result): f"cell-{number}" for number, result in enumerate(self.results)}

    @property
    def unit(self) -> Unit:
        """Unit of the metric that is compared."""
        return unit_of(self.metric)

    @property
    def axis(self) -> str:
        """The metric that is compared, with its unit, for an axis."""
        return ", ".join(filter(None, (self.metric, self.unit.name)))

    def text(self, value: float) -> str:
        """A value of that metric, with its unit."""
        return f"{self.unit.number(value)} {self.unit.name}".rstrip()

    @cached_property
    def estimators(self) -> list[str]:
        """The best first."""
        grouped = by_estimator(self.results)
        return sorted(grouped, key=lambda name: (median_metrics(grouped[name]).get(self.metric, np.inf), name))

    @cached_property
    def comparison(self) -> Comparison | None:
        """All pairs; None where nothing can be compared, such as runs without truth."""
        if len(self.estimators) < 2 or not self.scored_runs:
            return None
        try:
            return comparison(self.results, self.metric)
        except ParameterError:
            return None

    @cached_property
    def timing(self) -> dict[str, float]:
        """µs per measurement by estimator, empty when it was never measured."""
        return read_timing(self._store.folder)

    @cached_property
    def scored_runs(self) -> list[str]:
        """The first runs that count and have truth."""
        known = {result.cell.run.id for result in judged(self.results) if result.has_truth}
        return [run.id for run in self.suite.runs if run.id in known][:SHOWN_RUNS]

    @cached_property
    def has_errors(self) -> bool:
        """True where there is anything to draw: an estimator that answered, in a run with truth."""
        return any(result.worst_at_s is not None for result in judged(self.results))

    @cached_property
    def series(self) -> dict[tuple[str, str], Series]:
        """Clean cells of the first seed, by run and estimator, of the runs that are shown."""
        series = {}
        for result in self.results:
            cell = result.cell
            if cell.fault.id == CLEAN and cell.seed == 0 and cell.run.id in self.scored_runs:
                series[cell.run.id, cell.estimator.id] = self._series(result)
        return series

    def seeds(self, estimator: str, fault: str) -> list[list[Errors]]:
        """Of each shown run the errors of its seeds under one fault; a crashed one answered nothing."""
        own = by_estimator(self.results, fault).get(estimator, [])
        of_runs = [[result for result in own if result.cell.run.id == run_id] for run_id in self.scored_runs]
        series = [[self._series(result) for result in results] for results in of_runs]
        return [[errors(one.instants, one.answers) for one in seeds] for seeds in series]

    def fix_bound_m(self, series: Series) -> Floats:
        """The least error of a fix from one reading of every anchor, at each instant of a cell [m]."""
        run, true = self.run(series.result.cell.run.id), series.instants
        return fix_error(run.world.anchors, Places.of_poses(run.world, true.x, true.y, true.heading), radio_of(run))

    def run(self, run_id: str) -> Run:
        """The run itself; those that are shown are few, and are kept."""
        if run_id not in self._runs:
            self._runs[run_id] = open_run(self.suite.run(run_id), self.suite.folder)
        return self._runs[run_id]

    def _series(self, result: Result) -> Series:
        cell = result.cell
        _, instants, start_ns = reference_of(cell, self._store)
        track, fates = stored_track(cell, self._store)
        answers = match(instants, track, max_age_s=cell.evaluation.max_age_s)
        return Series(result, start_ns, instants, answers, fates)


def _ids(result: Result) -> tuple[str, str, str, int]:
    cell = result.cell
    return cell.run.id, cell.estimator.id, cell.fault.id, cell.seed
