"""Evidence in a series of correlated values, and the intervals that follow from it.

Errors a tenth of a second apart are nearly the same error: taken as independent they make any filter look
significantly inconsistent. So every interval here counts the effective number of samples instead.
"""

from __future__ import annotations

import math

import numpy as np

from fusion.arrays import Floats, Whole

TAIL = 0.025
"""Probability left out on either side: intervals hold with 95 %."""
NORMAL = 1.959963984540054
"""Of the normal distribution: that far from its mean, in standard deviations."""
BATCH = 1 << 16
"""Values transformed at once: more would cost memory and gain nothing."""


def effective_sizes(series: Floats, leader: Whole | None = None) -> Floats:
    """Effective sample size n / (1 + 2 sum of autocorrelations) of each row of ``series`` (k, n).

    The sum of autocorrelations is Geyer's initial monotone sequence (Statistical Science 7(4), 1992, section 3.3); no
    size exceeds n. A row that never changes has none of its own and takes that of its ``leader`` (k,), None: the first
    row; if this is constant as well, 1.
    """
    if series.shape[1] == 0:
        return np.full(len(series), np.nan)
    spans = np.maximum.reduce(series, axis=1) - np.minimum.reduce(series, axis=1)
    changing = np.flatnonzero(spans)
    sizes = np.ones(len(series))
    at_once = max(BATCH // series.shape[1], 1)
    for first in range(0, len(changing), at_once):
        rows = changing[first : first + at_once]
        chosen = series if len(rows) == len(series) else series[rows]
        sizes[rows] = _of_rows(chosen / spans[rows, None])
    followed = np.zeros(len(series), dtype=np.int64) if leader is None else leader
    return np.where(spans == 0.0, sizes[followed], sizes)


def _of_rows(series: Floats) -> Floats:
    """Autocorrelations by the fast Fourier transform (Wiener & Khinchin)."""
    count = series.shape[1]
    series -= np.add.reduce(series, axis=1, keepdims=True) / count
    lags = max(count // 4 * 2, 2)
    length = min(small << max((count + lags - 1) // small, 1).bit_length() for small in (4, 5, 6))
    spectrum = np.fft.rfft(series, length)
    covariance = np.fft.irfft(spectrum * spectrum.conj(), length)[:, :lags]
    return np.asarray(count / _time(covariance))


def _time(covariance: Floats) -> Floats:
    """1 + 2 sum of autocorrelations, at least 1, of autocovariances (k, an even number of lags)."""
    pairs = (covariance[:, 0::2] + covariance[:, 1::2]) / covariance[:, :1]
    negative = pairs <= 0.0
    ends = np.where(negative.any(axis=1), negative.argmax(axis=1), pairs.shape[1])
    positive = np.arange(ends.max(initial=0)) < ends[:, None]
    monotone = np.minimum.accumulate(pairs[:, : positive.shape[1]], axis=1)
    return np.asarray(np.maximum(2.0 * np.add.reduce(monotone, axis=1, where=positive) - 1.0, 1.0))


def binomial_interval(share: float, samples: float) -> tuple[float, float]:
    """95 % interval of a probability that showed as ``share`` of ``samples``, which need not be a whole number.

    The score interval (Wilson 1927), the one to use for few samples too (Brown, Cai & DasGupta 2001).
    """
    shrink = 1.0 + NORMAL**2 / samples
    centre = (share + 0.5 * NORMAL**2 / samples) / shrink
    reach = NORMAL / shrink * math.sqrt(share * (1.0 - share) / samples + 0.25 * NORMAL**2 / samples**2)
    return max(centre - reach, 0.0), min(centre + reach, 1.0)


def order_shares(share: float, samples: float) -> tuple[float, float]:
    """Shares whose quantiles are the 95 % interval of the quantile ``share``: the binomial order statistics.

    Of ``samples`` values the number below the true quantile is binomial, whatever their distribution.
    """
    reach = NORMAL * math.sqrt(share * (1.0 - share) / samples)
    return max(share - reach, 0.0), min(share + reach, 1.0)


def mean_chi_square_band(dimension: float, samples: float) -> tuple[float, float]:
    """Where the mean of ``samples`` chi-square variables of ``dimension`` degrees, over ``dimension``, lies with 95 %.

    The acceptance region of ANEES (Li, Zhao & Li 2012); ``samples`` need not be a whole number.
    """
    # Imported here, for it takes a quarter of a second, and many tracks claim nothing.
    from scipy.special import gammaincinv

    degrees = dimension * samples
    low, high = (2.0 * float(gammaincinv(0.5 * degrees, share)) / degrees for share in (TAIL, 1.0 - TAIL))
    return low, high
