"""Catalogue of metrics: id, unit, direction, title and needs of every number of a score, as tables and docs show it."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import NamedTuple

from benchmarks.metrics import innovations, score
from benchmarks.metrics.families import families
from benchmarks.metrics.metric import Better, Metric, Unit
from fusion import ParameterError

COST = Metric("cpu_per_measurement_s", "s/measurement", Better.LESS, "processor time per measurement", "none")
METRICS: Mapping[str, Metric] = {metric.id: metric for metric in (*score.METRICS, *innovations.METRICS, COST)}
"""Every metric of ours by id, in the order of the documentation."""
RANKED_BY = "pos_p75"


def row_of(metric: str) -> Metric | None:
    """The row of a metric, of ours or of another distribution; None of one that has none."""
    return METRICS.get(metric) or families().rows.get(metric)


class Column(NamedTuple):
    """One column of a table: a metric, and a short title."""

    key: str
    title: str
    unit: Unit

    def text(self, values: Mapping[str, object]) -> str:
        """The number as people read it: – where there is none."""
        return self.unit.number(values.get(self.key))


def unit_of(metric: str) -> Unit:
    """The unit in which people read a metric; of one that is not in the catalogue, that of a plain number.

    >>> unit_of("pos_p75").number(0.123), unit_of("anees").number(1.234), unit_of("head_n").name
    ('12.3', '1.23', '')
    """
    row = row_of(metric)
    return Unit("", 1.0, 2) if row is None else row.unit


def column(metric: str, title: str, *, decimals: int | None = None, separator: str = "\n") -> Column:
    """The column of a metric, its unit under the title, or behind another ``separator``."""
    unit = unit_of(metric)
    shown = unit if decimals is None else unit._replace(decimals=decimals)
    return Column(metric, f"{title}{separator}{unit.name}" if unit.name else title, shown)


COLUMNS = (
    column("pos_rmse", "RMSE"),
    column("pos_mean", "mean"),
    column("pos_p50", "median"),
    column("pos_p75", "p75"),
    column("pos_p95", "p95"),
    column("pos_max", "max"),
    column("head_rmse", "heading\nRMSE", separator=" "),
    column("anees", "ANEES"),
    column("availability", "avail."),
)


def more_is_better(metric: str) -> bool:
    """Whether the catalogue has the metric, and its greater values are better."""
    row = row_of(metric)
    return row is not None and row.better is Better.MORE


def require_lower_is_better(metric: str) -> None:
    """Raises `ParameterError` for a metric of which more is better, or a certain value: that the lower wins would be
    the wrong verdict; and for one that may be below zero, for verdicts are on ratios.
    """
    known = row_of(metric)
    if known is not None and known.better is not Better.LESS:
        raise ParameterError(f"a lower {metric} is not better, so it decides nothing here; {RANKED_BY} is usual")
    if known is not None and known.signed:
        raise ParameterError(f"{metric} may be below zero, so it has no ratio to decide by; {RANKED_BY} is usual")


def as_table() -> str:
    """The catalogue as a Markdown table: metrics that differ by their ids alone share a row."""
    lines = ["| Metric | Unit | Better | What it is | Needs |", "|---|---|---|---|---|"]
    for (unit, better, title, needs), group in groupby(METRICS.values(), key=lambda one: one[1:5]):
        ids = ", ".join(f"`{one.id}`" for one in group)
        lines.append(f"| {ids} | {unit} | {better.value} | {title} | {needs} |")
    return "\n".join(lines) + "\n"
