"""The results of a suite as they stand in the store."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import fusion
from benchmarks.metrics.catalogue import RANKED_BY
from benchmarks.metrics.score import METRICS_VERSION, quantile
from benchmarks.runner.execute import read_metrics
from benchmarks.runner.plan import Cell
from benchmarks.runner.store import Store
from benchmarks.runner.suite import CLEAN, TEST, Suite
from benchmarks.statistics.verdict import Comparison, compare
from fusion import ParameterError
from fusion.arrays import Floats
from fusion.errors import did_you_mean


class Result(NamedTuple):
    """One cell's score: infinite and NaN metrics are as in `benchmarks.metrics.score`. ``error``: why it
    was lost. ``worst_at_s``: when its position error was greatest, since the start of the run; None where there is no
    error, or no score. ``facts``: what became of the run and its readings. ``cpu_s``: the processor time of the fold,
    where that took place now.
    """

    cell: Cell
    status: str
    error: str | None
    digest: str
    metrics: Mapping[str, float]
    facts: Mapping[str, Any]
    worst_at_s: float | None
    cpu_s: float | None = None

    @property
    def run(self) -> str:
        """The id of the run."""
        return self.cell.run.id

    @property
    def estimator(self) -> str:
        """The id of the estimator."""
        return self.cell.estimator.id

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the run, a sentence each."""
        return tuple(self.facts["warnings"])

    @property
    def has_truth(self) -> bool:
        """True where there was a truth to score it against."""
        return "n" in self.metrics

    @property
    def cost_s(self) -> float | None:
        """Processor time per measurement [s]; None where it was not measured."""
        count = self.facts["measurements"]
        return self.cpu_s / count if self.cpu_s is not None and count else None


def read_results(cells: Iterable[Cell], store: Store) -> list[Result]:
    """Of the cells that have a score; those that have none are left out."""
    results = []
    for cell in cells:
        if store.has("scores", cell.score_key):
            scored = store.read_json("scores", cell.score_key, "result.json")
            made = store.read_json("estimates", cell.estimate_key, "result.json")
            ended = (scored["status"], scored["error"], made["digest"])
            results.append(Result(cell, *ended, read_metrics(scored), made, scored["worst_at_s"]))
    return results


def partly_headed(result: Result) -> str:
    """A sentence where the true heading is known at some instants only; else ""."""
    count, headed = (result.metrics.get(name, math.nan) for name in ("n", "head_n"))
    if not 0.0 < headed < count:
        return ""
    return f"the true heading is known at {headed:.0f} of {count:.0f} instants, and heading errors are of these alone"


def warnings(results: Sequence[Result]) -> list[str]:
    """Warnings of the runs, a sentence each after the id of the run."""
    return list(dict.fromkeys(f"{one.run}: {warning}" for one in results for warning in one.warnings))


def require_metric(metric: str, results: Sequence[Result]) -> None:
    """Raises `ParameterError` for a metric that no cell has; where no cell has any, all pass."""
    known = {name for result in results for name in result.metrics}
    if known and metric not in known:
        raise ParameterError(f"the suite has no metric {metric!r}; {did_you_mean(metric, sorted(known))}")


def judged(results: Sequence[Result]) -> list[Result]:
    """The results that count: those of the test runs with ground truth; where there is none such, of the test runs, or
    of all.
    """
    test = [result for result in results if result.cell.run.split == TEST] or list(results)
    return [result for result in test if result.has_truth] or test


def by_estimator(results: Sequence[Result], fault: str = CLEAN) -> dict[str, list[Result]]:
    """The results under one fault that count, by estimator, in the suite's order."""
    grouped: dict[str, list[Result]] = {}
    for result in judged(results):
        if result.cell.fault.id == fault:
            grouped.setdefault(result.estimator, []).append(result)
    return grouped


def by_run(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Results by run, in the suite's order."""
    grouped: dict[str, list[Result]] = {}
    for result in results:
        grouped.setdefault(result.run, []).append(result)
    return grouped


def median_metrics(results: Sequence[Result]) -> dict[str, float]:
    """The median over cells of every metric. A lost cell is infinite in the quantiles, so it cannot flatter; where a
    metric is undefined (NaN) the cell does not count.
    """
    names = {name for result in results for name in result.metrics}
    columns = {name: np.array([result.metrics.get(name, math.nan) for result in results]) for name in names}
    return {name: quantile(column[~np.isnan(column)], 0.5) for name, column in columns.items()}


def score_matrix(results: Sequence[Result], metric: str) -> Floats:
    """One estimator's scores under one fault, (runs, seeds), both in the suite's order."""
    rows = [[result.metrics.get(metric, math.inf) for result in own] for own in by_run(results).values()]
    return np.array([[math.inf if math.isnan(value) else value for value in row] for row in rows], dtype=np.float64)


def comparison(results: Sequence[Result], metric: str = RANKED_BY, fault: str = CLEAN) -> Comparison:
    """All pairs of estimators, the best first; raises `ParameterError` where they cannot be compared."""
    grouped = by_estimator(results, fault)
    order = sorted(grouped, key=lambda name: (median_metrics(grouped[name]).get(metric, math.inf), name))
    return compare({name: score_matrix(grouped[name], metric) for name in order}, metric)


def record(suite: Suite, results: Sequence[Result]) -> dict[str, object]:
    """Everything for strict JSON, in SI units: what `bench gate` takes as a baseline. NaN and infinity are None."""
    return {"suite": suite.name, "metrics_version": METRICS_VERSION, "results": [flat(result) for result in results]}


def flat(result: Result) -> dict[str, object]:
    """One result as one row."""
    cell = result.cell
    head = {"run": cell.run.id, "estimator": cell.estimator.id, "fault": cell.fault.id, "seed": cell.seed}
    tail = {"status": result.status, "error": result.error, "digest": result.digest, "split": cell.run.split}
    keys = {"estimate_key": cell.estimate_key, "score_key": cell.score_key}
    numbers = {key: value if math.isfinite(value) else None for key, value in result.metrics.items()}
    return {**head, **tail, **numbers, **keys}


def detailed(result: Result) -> dict[str, object]:
    """One result with everything that is known of it."""
    cell, facts = result.cell, result.facts
    return {
        **flat(result),
        "log": cell.run.mcap,
        "parameters": dict(cell.estimator.params),
        **{key: facts[key] for key in ("world", "world_hash", "measurements", "warnings", "fates")},
        "cpu_s": result.cpu_s,
        "cpu_per_measurement_s": result.cost_s,
        "versions": {"fusion": fusion.__version__, "numpy": np.__version__, "python": platform.python_version()},
    }
