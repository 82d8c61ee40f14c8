"""Scores as tables for people: centimetres, degrees, microseconds, the best first."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import IO, NamedTuple

from rich.box import SIMPLE_HEAD
from rich.table import Table

from benchmarks.cell import STATUSES, Score
from benchmarks.metrics.innovations import NAMES
from benchmarks.sheet import console


class Column(NamedTuple):
    """One number of a score: its key in the record, and how a person wants it."""

    key: str
    title: str
    factor: float
    decimals: int


COLUMNS = (
    Column("pos_rmse", "RMSE\ncm", 100.0, 1),
    Column("pos_mean", "mean\ncm", 100.0, 1),
    Column("pos_p50", "median\ncm", 100.0, 1),
    Column("pos_p75", "p75\ncm", 100.0, 1),
    Column("pos_p95", "p95\ncm", 100.0, 1),
    Column("pos_max", "max\ncm", 100.0, 1),
    Column("head_rmse", "heading\nRMSE °", math.degrees(1.0), 2),
    Column("anees", "ANEES", 1.0, 2),
    Column("availability", "avail.\n%", 100.0, 1),
    Column("cpu_per_measurement_s", "time\nµs/msg", 1e6, 0),
)
TRUTHLESS = COLUMNS[-2:]
"""Those that need no truth."""

LENGTHS = ("pos_", "abs_", "along_", "cross_", "bias_", "drms", "2drms", "max_in_outage", "energy")
"""How the ids of metrics in metres begin."""


class Unit(NamedTuple):
    """How people want a metric: what to multiply it by, and the unit it is in then."""

    factor: float
    name: str

    def number(self, value: float) -> str:
        """A value of the metric, without the unit; – where there is none."""
        if math.isnan(value):
            return "–"
        return "∞" if math.isinf(value) else f"{value * self.factor:.{1 if self.name else 2}f}"


def unit_of(metric: str) -> Unit:
    """Centimetres for lengths, degrees for headings; other metrics as they are.

    >>> unit_of("pos_p75").number(0.123), unit_of("anees").number(1.234)
    ('12.3', '1.23')
    """
    if metric.startswith(LENGTHS) and metric != "pos_auc":
        return Unit(100.0, "cm")
    return Unit(math.degrees(1.0), "°") if metric.startswith("head_") else Unit(1.0, "")


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


def as_text(column: Column, values: Mapping[str, object]) -> str:
    """A number as people read it: – where there is none."""
    value = values.get(column.key)
    if not isinstance(value, float) or math.isnan(value):
        return "–"
    return "∞" if math.isinf(value) else f"{value * column.factor:.{column.decimals}f}"
