"""Means and quantiles of errors, some of which may be infinite and some of which may count more than others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion.arrays import Flags, Floats


def known(values: Floats) -> Floats:
    """Those that are not NaN; most often that is all of them, which a sum shows fastest."""
    return values[~np.isnan(values)] if math.isnan(np.add.reduce(values)) else values


def mean(values: Floats | Flags, weight: Floats | None = None) -> float:
    """The mean, every value counting ``weight`` times (None: once); NaN of nothing."""
    if len(values) == 0:
        return math.nan
    return float(np.add.reduce(values, dtype=np.float64) / len(values) if weight is None else weighted(values, weight))


def weighted(values: Floats | Flags, weight: Floats) -> float:
    """Sum of values times weights over the sum of the weights."""
    return float(weight @ values / np.add.reduce(weight))


def means(rows: Floats | Flags, weight: Floats | None = None) -> list[float]:
    """The mean of each row of (k, n), values counting ``weight`` (n,) times (None: once); NaN of nothing."""
    count = rows.shape[1]
    if count == 0:
        return [math.nan] * len(rows)
    sums = (
        np.add.reduce(rows, axis=1, dtype=np.float64) / count
        if weight is None
        else rows @ weight / np.add.reduce(weight)
    )
    return list(sums.tolist())


def root_mean_square(values: Floats, weight: Floats | None = None) -> float:
    """The root of the mean square; NaN of nothing."""
    if weight is not None or len(values) == 0:
        return math.sqrt(mean(values * values, weight))
    return math.sqrt(values.dot(values) / len(values))


def root_mean_squares(rows: Floats, weight: Floats | None = None) -> list[float]:
    """The root of the mean square of each row of (k, n)."""
    return [math.sqrt(square) for square in means(rows * rows, weight)]


def quantile(values: Floats, share: float, weight: Floats | None = None) -> float:
    """Type-7 quantile (Hyndman & Fan 1996) of values that may be infinite; NaN without any.

    ``numpy.percentile`` answers NaN for the median of (1, 2, inf), for it computes 0 * inf.
    """
    count = len(values)
    if weight is not None or count == 0:
        return Ordered.of(values, weight).quantile(share)
    # One value in its place, and the least of those above it, cost less than putting all in order.
    below, part = _place((count - 1) * share)
    split = values.copy()
    split.partition(below)
    low = split.item(below)
    return _between(low, float(np.minimum.reduce(split[below + 1 :])), part) if part else low


def quantiles(rows: Floats, share: float, weight: Floats | None = None) -> list[float]:
    """The `quantile` of each row of (k, n)."""
    return [quantile(row, share, weight) for row in rows]


def _place(place: float) -> tuple[int, float]:
    """The index below a place among values in order, and the part of the way to the next one."""
    below = int(place)
    return below, place - below


def _between(low: float, high: float, part: float) -> float:
    """That part of the way from ``low`` to ``high``, either of which may be infinite."""
    if part == 0.0 or low == math.inf:
        return low
    return math.inf if high == math.inf else low + part * (high - low)


class Ordered(NamedTuple):
    """Values in order, (n,), for several quantiles. With weights, ``stands`` (n,) is the part of the way from
    the first to the last each one stands.
    """

    values: Floats
    stands: Floats | None

    @classmethod
    def of(cls, values: Floats, weight: Floats | None = None) -> Ordered:
        """With weights, value k stands at S_k / S_n with S_k the sum of (w_i + w_(i+1)) / 2 over i < k: for equal
        weights the (k - 1) / (n - 1) of type 7.
        """
        if weight is None or len(values) < 2:
            return cls(np.sort(values), None)
        order = np.argsort(values, kind="stable")
        sizes = weight[order]
        sums = np.concatenate([[0.0], np.cumsum(0.5 * (sizes[1:] + sizes[:-1]))])
        return cls(values[order], sums / sums[-1])

    def quantile(self, share: float) -> float:
        """The value below which that share lies."""
        count = len(self.values)
        if count == 0:
            return math.nan
        place = (count - 1) * share if self.stands is None else float(np.interp(share, self.stands, np.arange(count)))
        below, part = _place(place)
        return _between(self.values.item(below), self.values.item(min(below + 1, count - 1)), part)
