"""Whether the answers were as certain as they had a right to be, and how good they were as whole distributions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows
from fusion.arrays import Flags, Floats
from fusion.quantiles import known, mean

CHI_SQUARE_95 = {1: 3.841458820694124, 2: 5.991464547107979, 3: 7.814727903251179}
"""Values a chi-square variable of 1, 2 and 3 degrees of freedom exceeds once in twenty."""
CLAIM = "covariance"
METRICS = (
    *rows("anees anees_2d", "1", Better.NEITHER, "ANEES of pose and position: 1 is honest, more is too certain", CLAIM),
    *rows("cover95 cover95_2d", "share", Better.NEITHER, "share of errors inside the claimed 95 % region", CLAIM),
    *rows("nll_3d nll_2d", "nat", Better.LESS, "negative log-likelihood of pose and position", CLAIM, signed=True),
    *rows("energy", "m", Better.LESS, "energy score of the position: accuracy and honesty", CLAIM),
)
"""Of the functions below."""


class Claimed(NamedTuple):
    """Columns of the m instants with a covariance, all (m,): `Errors.nees`, its dimension, whether it is inside
    the 95 % region, and the run.
    """

    nees: Floats
    dimension: Floats
    hit: Flags

    @classmethod
    def of(cls, measured: Errors) -> Claimed:
        """Those of the instants with a claim."""
        claimed = ~np.isnan(measured.nees)
        nees, dimension = measured.nees, measured.dimension
        if not claimed.all():
            nees, dimension = nees[claimed], dimension[claimed]
        hit = nees <= np.where(dimension == 3, CHI_SQUARE_95[3], CHI_SQUARE_95[2])
        return cls(nees, dimension.astype(np.float64), hit)


def consistency_metrics(measured: Errors, claimed: Claimed) -> dict[str, float]:
    """ANEES (Li, Zhao & Li 2012), ideal 1, and the share of instants inside the 95 % region; NaN without covariances.

    Where headings are known at some instants only, each instant counts with its own dimension.
    """
    flat = known(measured.nees_2d)
    return {
        "anees": float(claimed.nees.sum() / claimed.dimension.sum()) if len(claimed.nees) else math.nan,
        "anees_2d": mean(flat) / 2.0,
        "cover95": mean(claimed.hit),
        "cover95_2d": mean(flat <= CHI_SQUARE_95[2]),
    }


def distribution_metrics(measured: Errors) -> dict[str, float]:
    """Proper scores (`benchmarks.metrics.proper_scores`), means over the instants with a claim; smaller is better."""
    columns = {"nll_3d": measured.nll, "nll_2d": measured.nll_2d, "energy": measured.energy}
    return {name: mean(known(column)) for name, column in columns.items()}
