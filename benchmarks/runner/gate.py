"""The gate of a suite: floors, and ratios to a baseline paired by run and seed; no lost or silent cell passes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from enum import IntEnum, unique
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.metrics.score import METRICS_VERSION
from benchmarks.runner.results import Result, by_estimator, score_matrix
from benchmarks.runner.scoring import ALIVE
from benchmarks.runner.suite import CLEAN, TEST, Gate
from benchmarks.statistics.verdict import compare
from fusion import SuiteError
from fusion.arrays import Floats
from fusion.output.html import data_of


@unique
class Outcome(IntEnum):
    """Outcome of a gate, of `bench verify` and of `bench replay`, as their exit code."""

    PASS = 0
    REGRESSION = 1
    USAGE = 2
    NOT_MEASURED = 3
    INCONCLUSIVE = 4
    NOT_DETERMINISTIC = 5


GRAVEST_FIRST = (
    Outcome.USAGE,
    Outcome.NOT_MEASURED,
    Outcome.NOT_DETERMINISTIC,
    Outcome.REGRESSION,
    Outcome.INCONCLUSIVE,
    Outcome.PASS,
)


class Finding(NamedTuple):
    """One condition of a gate, and what came of it."""

    outcome: Outcome
    text: str


def judge(results: Sequence[Result], gate: Gate, baseline: Baseline | None) -> list[Finding]:
    """Every condition of ``gate`` on results without faults."""
    findings = []
    for name, own in by_estimator(results, CLEAN).items():
        for metric, least in gate.floor.items():
            findings.append(_floor(name, own, metric, least))
        findings += [_inside(name, own, metric) for metric in gate.inside]
        if baseline is not None:
            findings += _against(name, own, gate, baseline.get(name))
    return findings


def _floor(name: str, own: Sequence[Result], metric: str, least: float) -> Finding:
    """A lost cell is below every floor; one without a value is inconclusive."""
    values = [result.metrics.get(metric, math.nan) for result in own]
    known = [
        -math.inf if math.isnan(value) and _is_lost(result) else value
        for value, result in zip(values, own, strict=True)
    ]
    silent = sum(map(math.isnan, known))
    worst = min((value for value in known if not math.isnan(value)), default=math.nan)
    text = f"{name}: {metric} is {worst:g} at worst, {least:g} at least is asked"
    if worst < least:
        return Finding(Outcome.REGRESSION, text)
    if silent:
        return Finding(Outcome.INCONCLUSIVE, f"{name}: {metric} is undefined in {silent} of {len(own)} cells")
    return Finding(Outcome.PASS, text)


def _is_lost(result: Result) -> bool:
    return result.status not in ALIVE


def _inside(name: str, own: Sequence[Result], metric: str) -> Finding:
    """Pass where every cell lies in its own chi-square band, which counts how correlated its errors are in time."""
    keys = (metric, f"{metric}_band_low", f"{metric}_band_high")
    value, low, high = np.array([[result.metrics.get(key, math.nan) for key in keys] for result in own]).T
    if not np.isfinite([value, low, high]).all():
        return Finding(Outcome.INCONCLUSIVE, f"{name}: {metric} has no band in every cell; does it claim a covariance?")
    outside = np.flatnonzero((value < low) | (value > high))
    text = f"{name}: {metric} lies outside its band in {len(outside)} of {len(own)} cells"
    return Finding(Outcome.REGRESSION if len(outside) else Outcome.PASS, text)


def _against(name: str, own: Sequence[Result], gate: Gate, before: Sequence[Row] | None) -> list[Finding]:
    if before is None:
        return [Finding(Outcome.INCONCLUSIVE, f"{name}: the baseline does not know it")]
    rows = counterparts(own, before)
    if rows is None:
        return [Finding(Outcome.INCONCLUSIVE, f"{name}: the baseline has other runs or seeds")]
    findings = [
        Finding(Outcome.REGRESSION, f"{result.cell}: {result.status}, and was not before")
        for result, row in zip(own, rows, strict=True)
        if _is_lost(result) and row["status"] in ALIVE
    ]
    for metric, margin in gate.ratio.items():
        now = score_matrix(own, metric)
        findings.append(_ratio(name, metric, margin, now, scores(rows, metric).reshape(now.shape)))
    return findings


def _ratio(name: str, metric: str, margin: float, now: Floats, before: Floats) -> Finding:
    """Regression when the whole interval of now over before is above 1 + margin, or a run is lost that was not; pass
    when all of it is below.
    """
    if np.allclose(now, before, rtol=1e-12, atol=0.0):
        return Finding(Outcome.PASS, f"{name}: {metric} is what it was")
    if not (np.minimum(now, before) > 0.0).all():
        return Finding(Outcome.USAGE, f"{name}: {metric} is not above 0 everywhere, and has no ratio; ask for another")
    (verdict,) = compare({"now": now, "before": before}, metric).verdicts
    ratio, low, high = verdict.ratio
    text = f"{name}: {metric} now / before {ratio:.3f} [{low:.3f}, {high:.3f}], margin {1.0 + margin:g}"
    if verdict.losses:
        lost = f"is infinite or missing in {verdict.losses} of {verdict.runs} runs where it was not"
        return Finding(Outcome.REGRESSION, f"{name}: {metric} {lost}")
    if low > 1.0 + margin:
        return Finding(Outcome.REGRESSION, text)
    return Finding(Outcome.PASS if high <= 1.0 + margin else Outcome.INCONCLUSIVE, text)


Row = Mapping[str, Any]
Baseline = Mapping[str, Sequence[Row]]
"""Rows of an earlier record, by estimator."""
Place = tuple[str, int]
"""The run and the seed of a cell."""


def read_baseline(path: Path) -> Baseline:
    """Results in the file of `fusion bench export --json`, or `report --html`, by estimator; raises `SuiteError`."""
    try:
        text = path.read_text(encoding="utf-8")
        stored = data_of(text) if path.suffix == ".html" else json.loads(text)
        version, grouped = stored["metrics_version"], _by_estimator(stored["results"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SuiteError(f"{path}: no baseline ({error}); write one with `fusion bench export --json`") from error
    if version != METRICS_VERSION:
        raise SuiteError(f"{path}: of metrics {version}, these are {METRICS_VERSION}; write the baseline anew")
    return grouped


def _by_estimator(rows: Sequence[Row]) -> Baseline:
    """The rows without faults; raises what rows raise that are none, or that are there twice."""
    grouped: dict[str, dict[Place, Row]] = {}
    for row in rows:
        estimator, fault, run, seed, _ = (row[key] for key in ("estimator", "fault", "run", "seed", "status"))
        if fault == CLEAN:
            own = grouped.setdefault(estimator, {})
            if (run, seed) in own:
                raise ValueError(f"{estimator} has two rows for {run}, seed {seed}")
            own[run, seed] = row
    return {estimator: list(own.values()) for estimator, own in grouped.items()}


def counterparts(own: Sequence[Result], before: Sequence[Row]) -> list[Row] | None:
    """The row of each of ``own``, by run and seed; None when one has none, or a run for testing is gone."""
    rows = {(row["run"], row["seed"]): row for row in before}
    places = [(result.cell.run.id, result.cell.seed) for result in own]
    asked = {place for place, row in rows.items() if row.get("split", TEST) == TEST and row["status"] != "unscored"}
    if not set(places) <= rows.keys() or not asked <= set(places):
        return None
    return [rows[place] for place in places]


def scores(rows: Sequence[Row], metric: str) -> Floats:
    """A metric of each row, (n,), infinite where it has none; raises `SuiteError` for a value that is no number."""
    return np.array([_score(row, metric) for row in rows])


def _score(row: Row, metric: str) -> float:
    value = row.get(metric)
    if value is None:
        return math.inf
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        where = f"{row['estimator']} in {row['run']}"
        raise SuiteError(f"the baseline's {metric} of {where} is {value!r}, no number; write the baseline anew")
    return float(value)
