"""Certainty of the figures of one run: 95 % intervals of position quantiles and coverage, and the band of ANEES.

All of them need effective sample sizes, and the transforms behind those cost more than all else; they are made at once.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.metrics.consistency import CLAIM, Claimed
from benchmarks.metrics.effective_samples import binomial_interval, effective_sizes, mean_chi_square_band, order_shares
from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows
from benchmarks.metrics.position import AUC_RADIUS_M, POSITION_QUANTILES
from fusion.arrays import Floats
from fusion.quantiles import Ordered, mean

CEILING = 1e6
"""For the correlation in time alone, a NEES counts as no more: beyond, one instant would hide all others."""
GREATEST = float(np.finfo(np.float64).max)
QUANTILE_ROWS = 1 + len(POSITION_QUANTILES)
LEADERS = np.array([*(0,) * QUANTILE_ROWS, *(QUANTILE_ROWS,) * 2])
"""A series that never changes counts as much as the error, or as the NEES."""
UNKNOWN_BANDS = dict.fromkeys(
    ("anees_n_eff", "anees_band_low", "anees_band_high", "cover95_n_eff", "cover95_low", "cover95_high"), math.nan
)

METRICS = (
    *rows("n_eff", "count", Better.MORE, "independent instants that all are worth, by the error's correlation"),
    *rows(
        " ".join(f"{name}_{end}" for name in POSITION_QUANTILES for end in ("low", "high")),
        "m",
        Better.LESS,
        "95 % interval of that quantile, by as many independent instants",
    ),
    *rows("anees_n_eff cover95_n_eff", "count", Better.MORE, "independent instants behind `anees`, `cover95`", CLAIM),
    *rows("anees_band_low anees_band_high", "1", Better.NEITHER, "band of an honest filter's ANEES, 95 %", CLAIM),
    *rows("cover95_low cover95_high", "share", Better.NEITHER, "95 % interval of `cover95`", CLAIM),
)
"""Of the functions below."""


def interval_metrics(measured: Errors, ordered: Ordered, claimed: Claimed) -> dict[str, float]:
    """`quantile_intervals` and `claim_intervals`."""
    if len(claimed.nees) < len(measured.position):
        return {**quantile_intervals(measured, ordered), **claim_intervals(claimed)}
    series = np.empty((len(LEADERS), len(measured.position)))
    _below(measured.position, ordered, series[:QUANTILE_ROWS])
    _hits(claimed, series[QUANTILE_ROWS:])
    sizes = effective_sizes(series, LEADERS).tolist()
    return {**_of_quantiles(ordered, sizes[:QUANTILE_ROWS]), **_of_claims(claimed, sizes[QUANTILE_ROWS:])}


def quantile_intervals(measured: Errors, ordered: Ordered) -> dict[str, float]:
    """``pos_p75_low`` and so on: 95 % intervals of the quantiles by binomial order statistics.

    ``n_eff`` is the effective sample size of the error, cut off at 3 m; each quantile's is that of being below it.
    """
    series = np.empty((QUANTILE_ROWS, len(measured.position)))
    _below(measured.position, ordered, series)
    return _of_quantiles(ordered, effective_sizes(series).tolist())


def claim_intervals(claimed: Claimed) -> dict[str, float]:
    """``anees_band_low`` and so on: where an honest filter's ANEES lies with 95 %, and the interval of its coverage.

    Approximate, for both take the effective sample size in place of the number of independent runs.
    """
    series = np.empty((2, len(claimed.nees)))
    _hits(claimed, series)
    return _of_claims(claimed, effective_sizes(series).tolist())


def _below(position: Floats, ordered: Ordered, series: Floats) -> None:
    """Fill the rows of ``series`` (6, n): the error, and whether it is no greater than each quantile."""
    limits = [min(ordered.quantile(share), GREATEST) for share in POSITION_QUANTILES.values()]
    np.minimum(position, AUC_RADIUS_M, out=series[0])
    np.less_equal(position, np.array(limits)[:, None], out=series[1:])


def _hits(claimed: Claimed, series: Floats) -> None:
    """Fill the rows of ``series`` (2, m): the NEES over its dimension, and whether it is inside the 95 % region."""
    np.minimum(claimed.nees / claimed.dimension, CEILING, out=series[0])
    series[1] = claimed.hit


def _of_quantiles(ordered: Ordered, sizes: list[float]) -> dict[str, float]:
    own, *others = sizes
    scores = {"n_eff": own}
    for (name, share), samples in zip(POSITION_QUANTILES.items(), others, strict=True):
        low, high = order_shares(share, samples)
        scores[f"{name}_low"], scores[f"{name}_high"] = ordered.quantile(low), ordered.quantile(high)
    return scores


def _of_claims(claimed: Claimed, sizes: list[float]) -> dict[str, float]:
    if len(claimed.nees) == 0:
        return UNKNOWN_BANDS
    samples, hits = sizes
    band = mean_chi_square_band(mean(claimed.dimension), samples)
    interval = binomial_interval(mean(claimed.hit), hits)
    return dict(zip(UNKNOWN_BANDS, (samples, *band, hits, *interval), strict=True))
