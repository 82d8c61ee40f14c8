"""Statistics over many seeds: the middle and the spread of a number, and how often something held."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.score import quantile
from fusion.arrays import Floats

LEVEL = 0.90
"""Of all intervals."""
CLEARLY_M = 0.001
"""Less is no difference. A method that refused every fix is odometry, and rounding must not make it the better one."""


def beats_both(errors_m: Floats, odometry_m: Floats, wifi_m: Floats) -> NDArray[np.bool_]:
    """True where errors [m] are clearly below those of odometry and those of Wi-Fi, run by run."""
    return np.asarray(errors_m < np.minimum(odometry_m, wifi_m) - CLEARLY_M)


class Spread(NamedTuple):
    """Median over seeds, and the interval that holds 90 % of them; infinite where that many runs had no answer."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Floats) -> Spread:
        """Of one number per seed, (n,)."""
        return cls(*(quantile(values, share) for share in (0.5, 0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0)))


def runs_to_exclude(share: float, limit: float) -> float:
    """Number of runs after which the interval of a `Share` that stays at ``share`` lies on one side of ``limit``.

    A Wilson interval of n runs excludes q where n (p - q)^2 >= z^2 q (1 - q); infinite for p = q.
    """
    z = NormalDist().inv_cdf(0.5 + LEVEL / 2.0)
    return z**2 * limit * (1.0 - limit) / (share - limit) ** 2 if share != limit else math.inf


class Share(NamedTuple):
    """Share of runs in which something held, with the 90 % interval of the probability behind it (Wilson 1927)."""

    held: int
    total: int
    low: float
    high: float

    @classmethod
    def of(cls, held: NDArray[np.bool_]) -> Share:
        """Of one answer per seed, (n,)."""
        from scipy.stats import binomtest

        interval = binomtest(int(held.sum()), held.size).proportion_ci(LEVEL, method="wilson")
        return cls(int(held.sum()), held.size, float(interval.low), float(interval.high))

    @property
    def value(self) -> float:
        """As a fraction."""
        return self.held / self.total
