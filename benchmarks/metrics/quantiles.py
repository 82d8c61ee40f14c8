"""Means and quantiles of errors, some of which may be infinite and some of which may count more than others."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.track import Floats


def mean(values: Floats | NDArray[np.bool_], weight: Floats | None = None) -> float:
    """The mean, every value counting ``weight`` times (None: once); NaN of nothing."""
    if len(values) == 0:
        return math.nan
    return float(np.add.reduce(values, dtype=np.float64) / len(values) if weight is None else weighted(values, weight))


def weighted(values: Floats | NDArray[np.bool_], weight: Floats) -> float:
    """Sum of values times weights over the sum of the weights."""
    return float(weight @ values / np.add.reduce(weight))


def root_mean_square(values: Floats, weight: Floats | None = None) -> float:
    """The root of the mean square; NaN of nothing."""
    return math.sqrt(mean(values * values, weight))


def quantile(values: Floats, share: float, weight: Floats | None = None) -> float:
    """Type-7 quantile (Hyndman & Fan 1996) of values that may be infinite; NaN without any.

    ``numpy.percentile`` answers NaN for the median of (1, 2, inf), for it computes 0 * inf.
    """
    return Ordered.of(values, weight).quantile(share)


class Ordered(NamedTuple):
    """Values in order, (n,), for several quantiles. With weights, ``stands`` (n,) says at what part of the way from
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
        below = int(place)
        part = place - below
        low, high = self.values[below].item(), self.values[min(below + 1, count - 1)].item()
        if part == 0.0 or low == math.inf:
            return float(low)
        return math.inf if high == math.inf else float(low + part * (high - low))
