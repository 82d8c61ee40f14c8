"""Two estimators on one run: a comparison that holds within it, and is labelled as not holding beyond it.

Errors of neighbouring instants are nearly the same, so instants cannot be drawn one by one. The stationary bootstrap
(Politis & Romano 1994) draws blocks of geometrically distributed length, the same for both estimators; their mean
length comes from the series itself (Politis & White 2004, as corrected by Patton, Politis & White 2009).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.score import quantile
from benchmarks.statistics.paired_tests import LEVEL, log_ratios
from benchmarks.statistics.verdict import by_percent
from fusion import ParameterError
from fusion.arrays import Floats

RESAMPLES = 1000
LEAST_INSTANTS = 30
"""Of fewer instants no block length can be found."""
QUIET_LAGS = 5
"""Politis & White give max(5, sqrt(log10 n)), which is 5 for every n that fits into a computer."""


@dataclass(frozen=True, slots=True)
class WithinRun:
    """Comparison of two estimators on one run: their ratio of error quantiles, first over second, and its percentile
    interval. It holds for these ``instants``; another run is another draw, of which it knows nothing.
    """

    first: str
    second: str
    metric: str
    instants: int
    block: float
    """Mean length of the blocks drawn, in instants."""
    ratio: float
    low: float
    high: float

    @property
    def winner(self) -> str | None:
        """The better of the two on this run; None: it is inconclusive."""
        if self.low <= 1.0 <= self.high:
            return None
        return self.first if self.high < 1.0 else self.second

    @property
    def sentence(self) -> str:
        """The verdict for people, labelled as what it is."""
        drawn = f"{self.instants} instants in blocks of {self.block:.0f}; other runs may differ"
        if self.winner is None:
            ratio = f"ratio {self.ratio:.2f} [{self.low:.2f}, {self.high:.2f}]"
            pair = f"inconclusive between {self.first} and {self.second}"
            return f"within this run, {pair} on {self.metric}: {ratio} ({drawn})"
        loser = self.second if self.winner == self.first else self.first
        gain = by_percent(self.ratio, self.low, self.high)
        return f"within this run, {self.winner} beats {loser} {gain} on {self.metric} ({drawn})"


def within_run(
    first: str,
    second: str,
    errors: Mapping[str, Floats],
    metric: str,
    share: float,
    *,
    seed: int = 0,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> WithinRun:
    """Compare two estimators by the ``share`` quantile of their ``errors`` (n,), infinite where there was no answer, at
    the same instants. Raises `ParameterError` where these do not belong together or are too few.
    """
    one, other = errors[first], errors[second]
    if len(one) != len(other) or len(one) < LEAST_INSTANTS:
        raise ParameterError(
            f"{metric}: {first} has {len(one)} errors and {second} {len(other)}; "
            f"give both at the same instants, at least {LEAST_INSTANTS}"
        )
    block = max(_block_length_of_quantile(series, share) for series in (one, other))
    random = np.random.Generator(np.random.PCG64(seed))
    draws = np.array([_ratio(one[i], other[i], share) for i in resampled(random, len(one), block, resamples)])
    low, high = (quantile(draws, tail) for tail in (0.5 * (1.0 - level), 0.5 * (1.0 + level)))
    return WithinRun(first, second, metric, len(one), block, _ratio(one, other, share), low, high)


def _ratio(one: Floats, other: Floats, share: float) -> float:
    return float(np.exp(log_ratios(np.array(quantile(one, share)), np.array(quantile(other, share)))))


def resampled(random: np.random.Generator, count: int, block: float, resamples: int) -> Iterator[NDArray[np.int64]]:
    """Indices of each resample (count,): after an instant comes the next one, the series closed to a ring, or with
    probability 1 / block any other.
    """
    instants = np.arange(count)
    for _ in range(resamples):
        begins = random.random(count) < 1.0 / block
        begins[0] = True
        begin = np.maximum.accumulate(np.where(begins, instants, 0))
        yield (random.integers(count, size=count)[begin] + instants - begin) % count


def _block_length_of_quantile(errors: Floats, share: float) -> float:
    """Of the hit indicator 1{error <= quantile}: to first order a quantile is its mean (Bahadur 1966)."""
    return block_length((errors <= quantile(errors, share)).astype(np.float64))


def block_length(series: Floats) -> float:
    """Mean block length of the stationary bootstrap that estimates the variance of the mean of ``series`` (n,) best.

    (G / g)^(2/3) n^(1/3) with flat-top weighted sums over all lags k, G of |k| R(k) and g of the autocovariance R(k)
    (Politis & White 2004; Patton, Politis & White 2009). At least 1, at most three roots of n and a third of n.
    """
    count = len(series)
    centred = series - series.mean()
    most = min(math.ceil(math.sqrt(count)) + QUIET_LAGS, count - 1)
    covariance = np.array([centred[lag:] @ centred[: count - lag] for lag in range(most + 1)]) / count
    if covariance[0] <= 0.0:
        return 1.0
    bandwidth = min(2 * _last_correlated_lag(covariance / covariance[0], count), most)
    lags = np.abs(np.arange(-bandwidth, bandwidth + 1))
    weighted = np.clip(2.0 * (1.0 - lags / bandwidth), 0.0, 1.0) * covariance[lags]
    spectrum, slope = float(weighted.sum()), float((lags * weighted).sum())
    longest = math.ceil(min(3.0 * math.sqrt(count), count / 3.0))
    length = (slope / spectrum) ** 2 * count if spectrum else math.inf
    return float(min(max(length ** (1.0 / 3.0), 1.0), longest))


def _last_correlated_lag(correlation: Floats, count: int) -> int:
    """The lag after which `QUIET_LAGS` correlations in a row are noise; the last that is not, without such a calm."""
    noise = np.abs(correlation[1:]) < 2.0 * math.sqrt(math.log10(count) / count)
    for lag in range(len(noise) - QUIET_LAGS + 1):
        if noise[lag : lag + QUIET_LAGS].all():
            return max(lag, 1)
    return int(np.flatnonzero(~noise)[-1]) + 1
