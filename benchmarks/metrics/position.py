"""Errors of position and heading (ISO/IEC 18305, section 8), along the map's axes and the robot's.

An instant without a valid answer counts as an infinite error in every quantile; means and root mean squares cover the
valid instants only and never rank alone. ``weight`` (n,), None where all instants count alike, states otherwise.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows
from fusion.arrays import Flags, Floats, points
from fusion.quantiles import Ordered, mean, means, quantile, quantiles, root_mean_square, root_mean_squares

AUC_RADIUS_M = 3.0
POSITION_QUANTILES = {"pos_p50": 0.50, "pos_p75": 0.75, "pos_p90": 0.90, "pos_p95": 0.95, "pos_p99": 0.99}
CDF_RADII_M = {"10cm": 0.1, "30cm": 0.3, "50cm": 0.5, "1m": 1.0, "2m": 2.0, "3m": 3.0}
"""By the ends of their ids."""
RADII_M = np.array([*CDF_RADII_M.values()])

METRICS = (
    *rows("n", "count", Better.MORE, "evaluation instants"),
    *rows("n_valid", "count", Better.MORE, "instants with a valid estimate"),
    *rows("availability", "share", Better.MORE, "share of instants with a valid estimate", "none"),
    *rows("pos_mean pos_rmse pos_std pos_min pos_max", "m", Better.LESS, "position error over valid instants"),
    *rows(" ".join(POSITION_QUANTILES), "m", Better.LESS, "quantile of the position error over all instants"),
    *rows(
        " ".join(f"pos_cdf_{name}" for name in CDF_RADII_M),
        "share",
        Better.MORE,
        "share of all instants with a position error within that radius",
    ),
    *rows("pos_auc", "1", Better.MORE, "area under that distribution function up to 3 m, over 3 m: 1 is perfect"),
    *rows(
        "abs_x_mean abs_x_max abs_x_min abs_y_mean abs_y_max abs_y_min",
        "m",
        Better.LESS,
        "absolute error along an axis of the map, as the paper has it; not to be compared with `pos_mean`",
    ),
    *rows("bias_x bias_y", "m", Better.NEITHER, "mean of the signed error"),
    *rows("cov_xx cov_xy cov_yy", "m^2", Better.NEITHER, "covariance of the signed error"),
    *rows("drms 2drms", "m", Better.LESS, "root of the trace of that covariance, and twice that"),
    *rows("along_rmse cross_rmse", "m", Better.LESS, "error along and across the true heading", "true heading"),
    *rows("along_bias cross_bias", "m", Better.NEITHER, "mean of the error along and across it", "true heading"),
    *rows("along_p95 cross_p95", "m", Better.LESS, "95 % quantile of its size, over all instants", "true heading"),
    *rows("head_n", "count", Better.MORE, "instants whose true heading is known"),
    *rows("head_mae head_rmse head_p95", "rad", Better.LESS, "heading error at these", "true heading"),
)
"""Of the functions below."""


def position_metrics(measured: Errors, ordered: Ordered) -> dict[str, float]:
    """Mean, RMSE, spread, quantiles, distribution function and the area under it to 3 m; ``ordered``: the errors.

    ``availability`` is the share of instants with a valid answer.
    """
    weight, position = measured.weight, measured.position
    answered = np.isfinite(position)
    valid, own = _where(answered, position, weight)
    centre = mean(valid, own)
    return {
        "n": float(len(position)),
        "n_valid": float(len(valid)),
        "availability": mean(answered, weight),
        "pos_mean": centre,
        "pos_rmse": root_mean_square(valid, own),
        "pos_std": root_mean_square(valid - centre, own),
        "pos_min": float(valid.min()) if len(valid) else math.nan,
        "pos_max": float(valid.max()) if len(valid) else math.nan,
        "pos_auc": mean(np.maximum(0.0, 1.0 - position / AUC_RADIUS_M), weight),
        **_within(position, ordered, weight),
        **{name: ordered.quantile(share) for name, share in POSITION_QUANTILES.items()},
    }


def _within(position: Floats, ordered: Ordered, weight: Floats | None) -> dict[str, float]:
    """``pos_cdf_1m`` and so on: the distribution function of the error, F(r), at named radii."""
    if weight is None and len(position):
        shares = (np.searchsorted(ordered.values, RADII_M, side="right") / len(position)).tolist()
    else:
        shares = means(position <= RADII_M[:, None], weight)
    return {f"pos_cdf_{name}": share for name, share in zip(CDF_RADII_M, shares, strict=True)}


def axis_metrics(measured: Errors) -> dict[str, float]:
    """Metrics along the map's axes: absolute errors in x and y as the paper has them, bias and covariance.

    Where errors are Gaussian and alike in all directions, a mean of ``abs_x`` is 36 % below ``pos_mean``: never compare
    one with the other.
    """
    error, weight = _where(np.isfinite(measured.position), np.array([measured.dx, measured.dy]), measured.weight)
    if error.shape[1] == 0:
        return dict.fromkeys(AXIS_IDS, math.nan)
    size = np.abs(error)
    bias = means(error, weight)
    from_x, from_y = error - np.array(bias)[:, None]
    xx, xy, yy = means(np.array([from_x * from_x, from_x * from_y, from_y * from_y]), weight)
    of_x, of_y = zip(means(size, weight), size.max(axis=1).tolist(), size.min(axis=1).tolist(), strict=True)
    drms = math.sqrt(xx + yy)
    return dict(zip(AXIS_IDS, (*of_x, *of_y, *bias, xx, xy, yy, drms, 2.0 * drms), strict=True))


AXIS_IDS = (
    *(f"abs_{axis}_{what}" for axis in "xy" for what in ("mean", "max", "min")),
    *("bias_x", "bias_y", "cov_xx", "cov_xy", "cov_yy", "drms", "2drms"),
)


def track_metrics(measured: Errors) -> dict[str, float]:
    """Errors along the true heading, forward positive, and across it, left positive: RMSE, bias, p95 of the size."""
    facing = measured.instants.facing
    turned = points(measured.dx, measured.dy) * facing.conj()
    error = np.array([turned.real, turned.imag])
    there = np.isfinite(error[0])
    valid, own = _where(there, error, measured.weight)
    asked = ~np.isnan(facing)
    size, weight = _where(asked, np.where(there, np.abs(error), np.inf), measured.weight)
    of_both = (root_mean_squares(valid, own), means(valid, own), quantiles(size, 0.95, weight))
    named = zip(("rmse", "bias", "p95"), of_both, strict=True)
    return {f"{side}_{what}": one for what, both in named for side, one in zip(("along", "cross"), both, strict=True)}


def heading_metrics(measured: Errors) -> dict[str, float]:
    """Of absolute heading errors [rad], at the ``head_n`` instants whose true heading is known; NaN for a method, or a
    truth, without any heading.
    """
    asked, weight = _where(~np.isnan(measured.heading), measured.heading, measured.weight)
    valid, own = _where(np.isfinite(asked), asked, weight)
    return {
        "head_n": float(len(asked)),
        "head_mae": mean(valid, own),
        "head_rmse": root_mean_square(valid, own),
        "head_p95": quantile(asked, 0.95, weight) if len(valid) else math.nan,
    }


def _where(kept: Flags, values: Floats, weight: Floats | None) -> tuple[Floats, Floats | None]:
    """The columns of ``values`` (..., n) that are ``kept`` (n,), and their weights; most often that is all of them."""
    if kept.all():
        return values, weight
    return values[..., kept], None if weight is None else weight[kept]
