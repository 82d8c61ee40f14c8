"""Whether the answers were as certain as they had a right to be, and how good they were as whole distributions."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.metrics.deviation import Errors
from benchmarks.metrics.quantiles import mean, means
from benchmarks.metrics.samples import binomial_interval, effective_sizes, mean_chi_square_band
from benchmarks.metrics.track import Flags, Floats, Whole

CHI_SQUARE_95 = {1: 3.841458820694124, 2: 5.991464547107979, 3: 7.814727903251179}
"""Values a chi-square variable of 1, 2 and 3 degrees of freedom exceeds once in twenty."""
CEILING = 1e6
"""For the correlation in time alone, a NEES counts as no more: beyond, one instant would hide all others."""
UNKNOWN_BANDS = dict.fromkeys(
    ("anees_n_eff", "anees_band_low", "anees_band_high", "cover95_n_eff", "cover95_low", "cover95_high"), math.nan
)


def consistency_metrics(measured: Errors) -> dict[str, float]:
    """ANEES (Li, Zhao & Li 2012), ideal 1, and the share of instants inside the 95 % region; NaN without covariances.

    Where headings are known at some instants only, each instant counts with its own dimension. An honest filter's
    ANEES lies in the band and 0.95 in the interval of its share, each with 95 %; approximate, for both take the
    effective sample size in place of the number of independent runs.
    """
    claimed = ~np.isnan(measured.nees)
    nees, dimension = measured.nees[claimed], measured.dimension[claimed]
    hit = nees <= np.where(dimension == 3, CHI_SQUARE_95[3], CHI_SQUARE_95[2])
    flat = measured.nees_2d[~np.isnan(measured.nees_2d)]
    bands = _bands(nees, dimension.astype(np.float64), hit, measured.run[claimed]) if len(nees) else UNKNOWN_BANDS
    return {
        "anees": float(nees.sum() / dimension.sum()) if len(nees) else math.nan,
        "anees_2d": mean(flat) / 2.0,
        "cover95": mean(hit),
        "cover95_2d": mean(flat <= CHI_SQUARE_95[2]),
        **bands,
    }


def _bands(nees: Floats, dimension: Floats, hit: Flags, run: Whole) -> dict[str, float]:
    samples, hits = effective_sizes(np.array([np.minimum(nees / dimension, CEILING), hit]), run).tolist()
    band = mean_chi_square_band(mean(dimension), samples)
    return dict(zip(UNKNOWN_BANDS, (samples, *band, hits, *binomial_interval(mean(hit), hits)), strict=True))


def distribution_metrics(measured: Errors) -> dict[str, float]:
    """Proper scores, means over the instants with a claim, smaller is better: see `benchmarks.metrics.claims`."""
    names, columns = ("nll_3d", "nll_2d", "energy"), np.array([measured.nll, measured.nll_2d, measured.energy])
    if not np.isnan(columns).any():
        return dict(zip(names, means(columns), strict=True))
    return {name: mean(column[~np.isnan(column)]) for name, column in zip(names, columns, strict=True)}
