"""Scores as tables for people: centimetres, degrees, microseconds, the best first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from benchmarks.metrics.catalogue import COLUMNS, COST, RANKED_BY, Column, column
from benchmarks.metrics.innovations import NAMES
from benchmarks.runner.results import Result, by_estimator, median_metrics
from benchmarks.runner.scoring import ALIVE, STATUSES
from benchmarks.runner.suite import CLEAN
from benchmarks.statistics.verdict import Comparison, Verdict
from fusion.output.tables import Table

WORST = "pos_rmse_worst"
"""The greatest RMSE of any cell, infinite where one was lost."""
WORST_COLUMN = column("pos_rmse", "worst\nRMSE", separator=" ")._replace(key=WORST)
COST_COLUMN = column(COST.id, "time")
AVAILABILITY_COLUMN = column("availability", "avail.")


class Entry(NamedTuple):
    """One row: an estimator, the statuses of its cells, and its metrics, of several cells their medians."""

    name: str
    statuses: tuple[str, ...]
    metrics: Mapping[str, float]

    @property
    def lost(self) -> int:
        """The number of cells that were lost."""
        return sum(status not in ALIVE for status in self.statuses)


def rank(entry: Entry) -> tuple[int, int, float, str]:
    """Sort key, the best first: by cells that were lost, by how they ended, then by the ranking metric."""
    ranking = entry.metrics.get(RANKED_BY, math.nan)
    worst = max(map(STATUSES.index, entry.statuses))
    return entry.lost, worst, math.inf if math.isnan(ranking) else ranking, entry.name


def entries(results: Sequence[Result], fault: str = CLEAN) -> list[Entry]:
    """The estimators under one fault, each with the medians over its cells that count, its worst RMSE and its cost."""
    return [_entry(name, own) for name, own in by_estimator(results, fault).items()]


def _entry(name: str, own: Sequence[Result]) -> Entry:
    metrics = median_metrics(own)
    if len(own) > 1:
        rmse = (one.metrics.get("pos_rmse", math.nan) for one in own)
        metrics[WORST] = max(math.inf if math.isnan(value) else value for value in rmse)
    costs = [one.cost_s for one in own if one.cost_s is not None]
    if costs:
        metrics[COST.id] = sum(costs) / len(costs)
    return Entry(name, tuple(one.status for one in own), metrics)


def leaderboard(title: str, rows: Sequence[Entry], columns: Sequence[Column] | None = None) -> Table:
    """The estimators, the best first; ``columns`` None: those that they have."""
    shown = columns_of(rows) if columns is None else columns
    several = any(len(row.statuses) > 1 for row in rows)
    corner = "position error of\nestimator" if any("n" in row.metrics for row in rows) else "consistency of\nestimator"
    head = (corner, *(["cells ok"] if several else []), *(one.title for one in shown))
    ranking = sorted(rows, key=rank)
    lines = [(*_name(row, several), *(one.text(row.metrics) for one in shown)) for row in ranking]
    return Table(title, head, tuple(lines))


def columns_of(rows: Sequence[Entry]) -> list[Column]:
    """Position errors; where there is no truth, consistency of the readings. With the cost where that was measured."""
    known = {name for row in rows for name in row.metrics}
    cost = [COST_COLUMN] if COST.id in known else []
    if "n" not in known:
        consistency = [one for sensor in NAMES if f"nis_{sensor}" in known for one in _nis(sensor)]
        return [*consistency, AVAILABILITY_COLUMN, *cost]
    worst = [WORST_COLUMN] if WORST in known else []
    return [COLUMNS[0], *worst, *COLUMNS[1:], *cost]


def _nis(sensor: str) -> tuple[Column, ...]:
    """NIS of a sensor's readings beside an honest filter's band."""
    return (
        column(f"nis_{sensor}", f"{sensor}\nNIS"),
        column(f"nis_{sensor}_low", "honest\nfrom"),
        column(f"nis_{sensor}_high", "\nto"),
        column(f"nis95_{sensor}", "inside\n95 %", separator=", "),
    )


def _name(row: Entry, several: bool) -> tuple[str, ...]:
    if several:
        return row.name, f"{len(row.statuses) - row.lost}/{len(row.statuses)}"
    return (f"{row.name} ({row.statuses[0]})" if row.lost else row.name,)


def suite_leaderboard(results: Sequence[Result], fault: str = CLEAN) -> Table:
    """The leaderboard of a suite under one fault."""
    return leaderboard(f"{fault}: medians over cells", entries(results, fault))


def pair_table(judged: Comparison) -> Table:
    """Every pair as one row."""
    rows = []
    for verdict in judged.verdicts:
        numbers = (
            _ratio(verdict),
            f"{verdict.compared} of {verdict.runs}",
            f"{verdict.holm_p:.2g}",
            f"{verdict.signed_rank.p:.2g}",
        )
        rows.append((f"{verdict.first} / {verdict.second}", *numbers, verdict.winner or "inconclusive"))
    head = ("pair", "ratio [95 %]", "runs compared", "p, Holm", "p, signed ranks", "better")
    return Table(f"Pairs on {judged.metric}", head, tuple(rows))


def _ratio(verdict: Verdict) -> str:
    """With its interval, which one run does not have."""
    ratio, low, high = verdict.ratio
    if verdict.compared == 0:
        return "–"
    return f"{ratio:.3f} [{low:.3f}, {high:.3f}]" if verdict.compared > 1 else f"{ratio:.3f}"
