"""An earlier record of a suite, which a gate compares with: its rows, and which of them belongs to which cell."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.metrics.score import METRICS_VERSION
from benchmarks.metrics.track import Floats
from benchmarks.page import data_of
from benchmarks.runner.definition import CLEAN, TEST
from benchmarks.runner.results import Result
from fusion import SuiteError

Row = Mapping[str, Any]
Baseline = Mapping[str, Sequence[Row]]
"""Rows of an earlier record, by contestant."""
Place = tuple[str, int]
"""The run and the seed of a cell."""


def read_baseline(path: Path) -> Baseline:
    """What `fusion bench export --json`, or `report --html`, has written, by contestant; raises `SuiteError`."""
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
    """The row of each of ``own``, told by run and seed; None when one has none, or a run for testing is gone."""
    rows = {(row["run"], row["seed"]): row for row in before}
    places = [(result.cell.run.id, result.cell.seed) for result in own]
    asked = {place for place, row in rows.items() if row.get("split", TEST) == TEST and row["status"] != "unscored"}
    if not set(places) <= rows.keys() or not asked <= set(places):
        return None
    return [rows[place] for place in places]


def scores(rows: Sequence[Row], metric: str) -> Floats:
    """What each row has of a metric, (n,), infinite where it has none; raises `SuiteError` for what is no number."""
    return np.array([_score(row, metric) for row in rows])


def _score(row: Row, metric: str) -> float:
    value = row.get(metric)
    if value is None:
        return math.inf
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        where = f"{row['estimator']} in {row['run']}"
        raise SuiteError(f"the baseline's {metric} of {where} is {value!r}, no number; write the baseline anew")
    return float(value)
