"""How good the answers were: the metrics, each one pure function of arrays, in metres and radians.

Coverage is part of the score. An instant without a valid answer counts as an infinite error in every quantile;
means and root mean squares cover the valid instants only and never rank alone. Nothing is aligned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.instants import Answers, Instants, wrap_angles
from benchmarks.track import Floats

METRICS_VERSION = 1
"""Changes whenever a metric does, so that stored scores are not taken for current ones."""
AUC_RADIUS_M = 3.0
CHI_SQUARE_95 = {2: 5.991464547107979, 3: 7.814727903251179}
"""Values a chi-square variable of 2 and 3 degrees of freedom exceeds once in twenty."""
POSITION_QUANTILES = {"pos_p50": 0.50, "pos_p75": 0.75, "pos_p90": 0.90, "pos_p95": 0.95, "pos_p99": 0.99}


class Errors(NamedTuple):
    """Errors at the evaluation instants, all (n,): what every metric is computed from, and what runs are pooled by.

    ``position`` [m]: infinite without a valid answer. ``heading`` [rad], absolute: NaN where the truth has none,
    infinite where only the answer has none. ``nees``: squared Mahalanobis distance of the error, over ``dimension``
    3, or 2 where a heading is missing; ``nees_2d`` of the position alone; both NaN where no covariance was claimed.
    """

    position: Floats
    heading: Floats
    nees: Floats
    dimension: NDArray[np.int64]
    nees_2d: Floats


def errors(instants: Instants, answers: Answers) -> Errors:
    """The errors of ``answers``, which belong to ``instants`` one by one."""
    valid = answers.valid
    dx, dy = answers.x - instants.x, answers.y - instants.y
    turn = wrap_angles(answers.heading - instants.heading)
    heading = np.where(valid & np.isfinite(turn), np.abs(turn), np.inf)
    error = np.stack([dx, dy, turn], axis=-1)
    nees_2d = _nees(error[:, :2], answers.covariance[:, :2, :2], valid)
    whole = np.isfinite(turn)
    return Errors(
        position=np.where(valid, np.hypot(dx, dy), np.inf),
        heading=np.where(np.isnan(instants.heading), np.nan, heading),
        nees=np.where(whole, _nees(error, answers.covariance, valid & whole), nees_2d),
        dimension=np.where(whole, 3, 2),
        nees_2d=nees_2d,
    )


def _nees(error: Floats, covariance: Floats, asked: NDArray[np.bool_]) -> Floats:
    """eᵀ P⁻¹ e (Bar-Shalom, Li, Kirubarajan 2001) where asked and claimed, else NaN; infinite where P is singular."""
    claimed = asked & np.isfinite(covariance).all(axis=(1, 2))
    nees = np.full(len(error), np.nan)
    definite = claimed.copy()
    definite[claimed] = np.linalg.eigvalsh(covariance[claimed])[:, 0] > 0.0
    nees[claimed & ~definite] = np.inf
    whitened = np.linalg.solve(covariance[definite], error[definite][..., None])[..., 0]
    nees[definite] = np.einsum("ni,ni->n", error[definite], whitened)
    return nees


def pool(parts: Sequence[Errors]) -> Errors:
    """All instants of all parts together."""
    return Errors(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def quantile(values: Floats, share: float) -> float:
    """Type-7 quantile (Hyndman & Fan 1996) of values that may be infinite; NaN without any.

    ``numpy.percentile`` answers NaN for the median of (1, 2, inf), for it computes 0 * inf.
    """
    if len(values) == 0:
        return math.nan
    ordered = np.sort(values)
    place = (len(ordered) - 1) * share
    below = math.floor(place)
    weight = place - below
    low, high = float(ordered[below]), float(ordered[min(below + 1, len(ordered) - 1)])
    if weight == 0.0 or math.isinf(low):
        return low
    return math.inf if math.isinf(high) else low + weight * (high - low)


def metrics(measured: Errors) -> dict[str, float]:
    """All metrics by id, in m and rad; shares in [0, 1]. NaN where nothing can be said, infinite where most is lost."""
    return {
        **position_metrics(measured.position),
        **heading_metrics(measured.heading),
        **consistency_metrics(measured),
    }


def position_metrics(position: Floats) -> dict[str, float]:
    """Of position errors (n,) [m], infinite where there was no valid answer (ISO/IEC 18305, section 8)."""
    valid = position[np.isfinite(position)]
    count = len(position)
    scores = {
        "n": float(count),
        "n_valid": float(len(valid)),
        "availability": len(valid) / count if count else math.nan,
        "pos_mean": _mean(valid),
        "pos_rmse": math.sqrt(_mean(valid**2)),
        "pos_std": float(np.std(valid)) if len(valid) else math.nan,
        "pos_min": float(valid.min()) if len(valid) else math.nan,
        "pos_max": float(valid.max()) if len(valid) else math.nan,
        "pos_auc": _mean(np.maximum(0.0, 1.0 - position / AUC_RADIUS_M)),
    }
    return scores | {name: quantile(position, share) for name, share in POSITION_QUANTILES.items()}


def heading_metrics(heading: Floats) -> dict[str, float]:
    """Of absolute heading errors (n,) [rad]; all NaN for a method, or a truth, that never tells a heading."""
    asked = heading[~np.isnan(heading)]
    valid = asked[np.isfinite(asked)]
    return {
        "head_mae": _mean(valid),
        "head_rmse": math.sqrt(_mean(valid**2)),
        "head_p95": quantile(asked, 0.95) if len(valid) else math.nan,
    }


def consistency_metrics(measured: Errors) -> dict[str, float]:
    """ANEES (Li, Zhao, Li 2012), ideal 1, and the share of instants inside the 95 % region; NaN without covariances.

    Where headings are known at some instants only, each instant counts with its own dimension.
    """
    claimed = ~np.isnan(measured.nees)
    nees, dimension = measured.nees[claimed], measured.dimension[claimed]
    limit = np.where(dimension == 3, CHI_SQUARE_95[3], CHI_SQUARE_95[2])
    return {
        "anees": float(nees.sum() / dimension.sum()) if len(nees) else math.nan,
        "anees_2d": _mean(measured.nees_2d[~np.isnan(measured.nees_2d)]) / 2.0,
        "cover95": _mean(nees <= limit),
    }


def _mean(values: Floats | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else math.nan
