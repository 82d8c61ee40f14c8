"""Paired tests of estimators, as pure functions of arrays.

The unit is the recorded run, never the frame: errors a tenth of a second apart are nearly the same error, and a test
that counts them as many finds a difference between equal estimators four times in five. What is compared is the
logarithm of the ratio of two scores, run by run, so a percentage means the same in an easy run and in a hard one.

At every number of runs the headline is Student's t interval: in simulation it holds its level from four runs on,
while the bootstraps usually offered for small samples, percentile and BCa, cover 80 to 90 % where they promise 95 %.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from fusion.arrays import Floats

Number = TypeVar("Number", float, Floats)

LEVEL = 0.95
"""Confidence of every interval unless asked otherwise."""
POWER = 0.80
"""A difference counts as detectable when a test finds it this often."""
MAX_RUNS = 10_000
"""More runs than anybody will drive: an effect that needs more counts as none."""


class MeanInterval(NamedTuple, Generic[Number]):
    """Student's t interval of a mean, all of one shape: the mean, the interval's ends, the standard deviation of one
    sample, and the two-sided p of mean zero. Of fewer than two samples everything is possible: (-inf, inf), p 1.
    """

    mean: Number
    low: Number
    high: Number
    std: Number
    p: Number


class SignedRank(NamedTuple):
    """Wilcoxon's signed-rank sum, positive minus negative, and its exact two-sided p."""

    sum: float
    p: float


def log_ratios(first: Floats, second: Floats) -> Floats:
    """ln(first / second) of scores (runs,), lower is better and +inf is lost: -inf where only the second is lost, +inf
    where only the first is, 0 where both are.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(first) - np.log(second)
    return np.where(first == second, 0.0, logs)


def mean_interval(samples: Floats, level: float = LEVEL) -> MeanInterval[Floats]:
    """Of finite samples (..., n) along the last axis."""
    from scipy.special import stdtr, stdtrit

    count = samples.shape[-1]
    if count < 2:
        mean = samples.mean(axis=-1) if count else np.full(samples.shape[:-1], np.nan)
        everything = np.full(mean.shape, np.inf)
        return MeanInterval(mean, -everything, everything, np.full(mean.shape, np.nan), np.ones(mean.shape))
    mean, std = samples.mean(axis=-1), samples.std(axis=-1, ddof=1)
    error = std / math.sqrt(count)
    reach = stdtrit(count - 1, 0.5 * (1.0 + level)) * error
    with np.errstate(divide="ignore", invalid="ignore"):
        p = 2.0 * stdtr(count - 1, -np.abs(mean) / error)
    # Samples that are all zero leave 0 / 0, and no reason to doubt that their mean is zero.
    return MeanInterval(mean, mean - reach, mean + reach, std, np.where(np.isnan(p), 1.0, p))


def mid_ranks(values: Floats) -> Floats:
    """Ranks from 1 along the last axis; equal values, infinite ones too, share the mean of their ranks."""
    one, other = values[..., :, None], values[..., None, :]
    return np.asarray((other < one).sum(axis=-1) + 0.5 * ((other == one).sum(axis=-1) + 1.0))


def signed_rank(differences: Floats) -> SignedRank:
    """Wilcoxon's test (1945) that differences (n,) are symmetric about zero, exact also with ties; infinite
    differences are the greatest, zeros are left out. The least p there is, is 2 / 2^n: with five runs 0.0625.
    """
    kept = differences[differences != 0.0]
    ranks = np.rint(2.0 * mid_ranks(np.abs(kept))).astype(np.int64)  # doubled, so that mid-ranks are whole
    total, positive = int(ranks.sum()), int(ranks[kept > 0.0].sum())
    share = np.zeros(total + 1)  # of all sign patterns, those with this sum of positive ranks
    share[0] = 1.0
    for rank in ranks:
        share = 0.5 * (share + np.concatenate([np.zeros(rank), share[: total + 1 - rank]]))
    tail = float(share[: min(positive, total - positive) + 1].sum())
    return SignedRank(0.5 * (2 * positive - total), min(1.0, 2.0 * tail))


def holm(p: Floats) -> Floats:
    """The p of a family of tests (n,), adjusted: below 5 %, at most one family in twenty holds a false finding
    (Holm 1979).
    """
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def friedman_p(scores: Floats) -> float:
    """The p that all estimators are alike, from scores (runs, estimators) ranked within each run, the lost ones last
    (Friedman 1937, with ties as in Conover 1999). By chi-square, so only rough below about six runs.
    """
    from scipy.special import chdtrc

    runs, estimators = scores.shape
    ranks = mid_ranks(scores)
    middle = 0.5 * (estimators + 1.0)
    spread = float(np.square(ranks - middle).sum())
    between = float(np.square(ranks.sum(axis=0) - runs * middle).sum())
    return float(chdtrc(estimators - 1, (estimators - 1) * between / spread)) if spread else 1.0


def detectable_effect(runs: int, level: float = LEVEL, power: float = POWER) -> float:
    """The least mean difference, in standard deviations of one run, that the two-sided t test finds with ``power``:
    (t.975 + t.80) / sqrt(runs), infinite below two runs.
    """
    from scipy.special import stdtrit

    if runs < 2:
        return math.inf
    return float(stdtrit(runs - 1, 0.5 * (1.0 + level)) + stdtrit(runs - 1, power)) / math.sqrt(runs)


def runs_needed(effect: float, level: float = LEVEL, power: float = POWER) -> int | None:
    """The least number of runs at which ``effect`` [standard deviations of one run] is detectable; None if that is
    more than `MAX_RUNS`, or the effect is not known.
    """

    def is_detectable(runs: int) -> bool:
        return detectable_effect(runs, level, power) <= effect

    return bisect_left(range(MAX_RUNS), True, key=is_detectable) if is_detectable(MAX_RUNS) else None
