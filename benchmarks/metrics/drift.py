"""Growth of errors while nothing corrects them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows
from fusion.arrays import Floats, Whole
from fusion.quantiles import quantile

MOST_PAIRS = 3000
"""Slopes that a median is taken of. Of more pairs than these every k-th is used: the median then strays a tenth more
than that of all would."""
EAG = "slope of the error over the time since the last radio fix used"
METRICS = rows("eag", "m/s", Better.LESS, EAG, "used fixes", signed=True)
"""Of the function below."""


def drift_metrics(measured: Errors) -> dict[str, float]:
    """``eag`` [m/s], the error accumulation gradient of the PDR benchmarks: the slope of the position error over the
    time since the last absolute fix that was used; NaN where no fixes are known.
    """
    since_fix_s, position = measured.since_fix_s, measured.position
    known = np.isfinite(since_fix_s + position)
    return {"eag": theil_sen(since_fix_s, position) if known.all() else theil_sen(since_fix_s[known], position[known])}


def theil_sen(at: Floats, values: Floats) -> float:
    """Median slope of ``values`` (n,) over ``at`` (n,) between all pairs of points (Theil 1950; Sen 1968), pairs at
    one place left out; NaN without a pair. Exact up to 77 points, beyond that of evenly spread pairs.
    """
    first, second = pairs_of(len(at))
    run, rise = at.take(second) - at.take(first), values.take(second) - values.take(first)
    apart = run != 0.0
    if not apart.all():
        run, rise = run[apart], rise[apart]
    return quantile(rise / run, 0.5)


@lru_cache(maxsize=64)
def pairs_of(count: int) -> tuple[Whole, Whole]:
    """Pairs (i, j), i < j, of ``count`` points, at most `MOST_PAIRS`, spread evenly over the list of all of them:
    (0, 1), (0, 2), (1, 2), (0, 3) ...
    """
    pairs = count * (count - 1) // 2
    chosen = np.arange(0, pairs, max(-(-pairs // MOST_PAIRS), 1), dtype=np.int64)
    second = np.floor(0.5 * (1.0 + np.sqrt(1.0 + 8.0 * chosen))).astype(np.int64)
    # The root may be rounded across a whole number.
    second -= second * (second - 1) // 2 > chosen
    second += second * (second + 1) // 2 <= chosen
    return chosen - second * (second - 1) // 2, second
