"""Means and quantiles of errors, some of which may be infinite and some of which may count more than others."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.instants import Floats


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
    return quantiles(values, [share], weight)[0]


def quantiles(values: Floats, shares: Sequence[float], weight: Floats | None = None) -> list[float]:
    """Several quantiles of the same values.

    With weights, the ordered value k stands at the share S_k / S_n with S_k the sum of (w_i + w_(i+1)) / 2 over i < k,
    which for equal weights is the (k - 1) / (n - 1) of type 7.
    """
    if len(values) == 0:
        return [math.nan] * len(shares)
    if weight is None:
        ordered = np.sort(values)
        places = [(len(ordered) - 1) * share for share in shares]
    else:
        order = np.argsort(values, kind="stable")
        ordered, sizes = values[order], weight[order]
        stands = np.concatenate([[0.0], np.cumsum(0.5 * (sizes[1:] + sizes[:-1]))])
        places = np.interp([share * stands[-1] for share in shares], stands, np.arange(len(stands))).tolist()
    return [_between(ordered, place) for place in places]


def _between(ordered: Floats, place: float) -> float:
    below = math.floor(place)
    part = place - below
    low, high = float(ordered[below]), float(ordered[min(below + 1, len(ordered) - 1)])
    if part == 0.0 or math.isinf(low):
        return low
    return math.inf if math.isinf(high) else low + part * (high - low)
