"""Scores as tables for people: centimetres, degrees, microseconds, the best first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import IO

from rich.box import SIMPLE_HEAD
from rich.table import Table

from benchmarks.cell import ALIVE, STATUSES, Score
from benchmarks.metrics.catalogue import COLUMNS, RANKED_BY, Column, as_text
from benchmarks.metrics.innovations import NAMES
from benchmarks.runner.results import Result, by_estimator, median_metrics
from benchmarks.runner.suite import CLEAN
from benchmarks.statistics.verdict import Comparison, Verdict
from fusion.output.tables import Sheet, console

TRUTHLESS = COLUMNS[-2:]
"""Those that need no truth."""


def partly_headed(metrics: Mapping[str, float]) -> str:
    """A sentence where the true heading is known at some instants only; else ""."""
    count, headed = metrics.get("n", math.nan), metrics.get("head_n", math.nan)
    if not 0.0 < headed < count:
        return ""
    return f"the true heading is known at {headed:.0f} of {count:.0f} instants, and heading errors are of these alone"


def ranked(scores: Sequence[Score]) -> list[Score]:
    """The best first: by status, then by the third quartile of the position error, infinite last."""

    def key(score: Score) -> tuple[int, float, str]:
        third_quartile = score.metrics.get("pos_p75", math.nan)
        return STATUSES.index(score.status), math.inf if math.isnan(third_quartile) else third_quartile, score.estimator

    return sorted(scores, key=key)


def print_tables(scores: Sequence[Score], pooled: Sequence[Score], file: IO[str] | None = None) -> None:
    """One table per run, and one over all of them where there are several with truth."""
    output = console(file)
    by_log: dict[object, list[Score]] = {}
    for score in scores:
        by_log.setdefault(score.facts.get("log", score.run), []).append(score)
    for own in by_log.values():
        output.print((_table if _is_scored(own) else _truthless)(own[0].run, own))
    scored = sum(map(_is_scored, by_log.values()))
    if scored > 1:
        which = f"all {scored} runs" if scored == len(by_log) else f"the {scored} runs with truth"
        output.print(_table(f"{which} together", pooled))


def _is_scored(scores: Sequence[Score]) -> bool:
    return any(score.errors is not None for score in scores)


def _truthless(run: str, scores: Sequence[Score]) -> Table:
    """A table for a log without truth: NIS of the readings beside an honest filter's band, availability and time."""
    columns: list[Column] = []
    for sensor in NAMES:
        if any(f"nis_{sensor}" in score.facts for score in scores):
            columns += [
                Column(f"nis_{sensor}", f"{sensor}\nNIS", 1.0, 2),
                Column(f"nis_{sensor}_low", "honest\nfrom", 1.0, 2),
                Column(f"nis_{sensor}_high", "\nto", 1.0, 2),
                Column(f"nis95_{sensor}", "inside\n95 %, %", 100.0, 1),
            ]
    return _table(f"{run}, without truth", scores, "consistency of\nestimator", (*columns, *TRUTHLESS))


def _table(
    title: str,
    scores: Sequence[Score],
    corner: str = "position error of\nestimator",
    columns: Sequence[Column] = COLUMNS,
) -> Table:
    table = Table(title=title, box=SIMPLE_HEAD, title_justify="left", pad_edge=False)
    table.add_column(corner, no_wrap=True)
    for column in columns:
        table.add_column(column.title, justify="right", no_wrap=True)
    for score in ranked(scores):
        remark = "" if score.status in ("ok", "unscored") else f" ({score.status})"
        values = {**score.facts, **score.metrics}
        table.add_row(score.estimator + remark, *(as_text(column, values) for column in columns))
    return table


def leaderboard(results: Sequence[Result], fault: str = CLEAN) -> Sheet:
    """The estimators, the best first: by how many cells were lost, then by the median of the ranking metric."""
    shown = [column for column in COLUMNS if column.key != "cpu_per_measurement_s"]
    rows = []
    for name, own in by_estimator(results, fault).items():
        lost, medians = sum(result.status not in ALIVE for result in own), median_metrics(own)
        numbers = (as_text(column, medians) for column in shown)
        rows.append(((lost, medians.get(RANKED_BY, math.inf), name), (name, f"{len(own) - lost}/{len(own)}", *numbers)))
    head = ("position error of", "cells ok", *(column.title for column in shown))
    return Sheet(f"{fault}: medians over cells", head, tuple(row for _, row in sorted(rows)))


def sheet(judged: Comparison) -> Sheet:
    """Every pair as one row."""
    rows = []
    for verdict in judged.verdicts:
        runs = f"{verdict.compared} of {verdict.runs}"
        numbers = (
            _ratio(verdict),
            runs,
            f"{verdict.holm_p:.2g}",
            f"{verdict.signed_rank.p:.2g}",
        )
        rows.append((f"{verdict.first} / {verdict.second}", *numbers, verdict.winner or "cannot tell"))
    head = ("pair", "ratio [95 %]", "runs compared", "p, Holm", "p, signed ranks", "better")
    return Sheet(f"Pairs on {judged.metric}", head, tuple(rows))


def _ratio(verdict: Verdict) -> str:
    """With its interval, which one run does not have."""
    ratio, low, high = verdict.ratio
    if verdict.compared == 0:
        return "–"
    return f"{ratio:.3f} [{low:.3f}, {high:.3f}]" if verdict.compared > 1 else f"{ratio:.3f}"
