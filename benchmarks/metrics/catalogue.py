"""Units, directions and titles of metrics."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from fusion import ParameterError


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

    >>> unit_of("pos_p75").number(0.123), unit_of("anees").number(1.234), unit_of("head_n").name
    ('12.3', '1.23', '')
    """
    if metric.startswith(LENGTHS) and metric != "pos_auc":
        return Unit(100.0, "cm")
    if metric.startswith("head_") and metric != "head_n":
        return Unit(math.degrees(1.0), "°")
    return Unit(1.0, "")


def as_text(column: Column, values: Mapping[str, object]) -> str:
    """A number as people read it: – where there is none."""
    value = values.get(column.key)
    if not isinstance(value, float) or math.isnan(value):
        return "–"
    return "∞" if math.isinf(value) else f"{value * column.factor:.{column.decimals}f}"


RANKED_BY = "pos_p75"


MORE_IS_BETTER = re.compile(
    r"n|n_valid|head_n|.*n_eff|.*availability|cover.*|pos_auc|pos_cdf_.*|t_conv_share|nis95_.*|white_.*|rpe_.*_n"
)


NEITHER_IS_BETTER = re.compile(r"anees.*|nll_.*|.*bias.*|cov_.*|path_ratio|eag|.*growth")
"""Their best is 1 or 0, or they may be negative and so have no ratio."""


def require_lower_is_better(metric: str) -> None:
    """Raises `ParameterError` for a metric of which more is better, or a certain value: that the lower wins would be
    the wrong verdict.
    """
    if MORE_IS_BETTER.fullmatch(metric) or NEITHER_IS_BETTER.fullmatch(metric):
        raise ParameterError(f"a lower {metric} is not better, so it decides nothing here; {RANKED_BY} is usual")
