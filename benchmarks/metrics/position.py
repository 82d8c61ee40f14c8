"""How far off the position and the heading were (ISO/IEC 18305, section 8), along the map's axes and the robot's.

An instant without a valid answer counts as an infinite error in every quantile; means and root mean squares cover the
valid instants only and never rank alone. ``weight`` (n,), None where all instants count alike, may tell otherwise.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.metrics.deviation import Errors
from benchmarks.metrics.quantiles import Ordered, mean, quantile, root_mean_square
from benchmarks.metrics.samples import effective_sizes, order_shares
from benchmarks.metrics.track import Floats

AUC_RADIUS_M = 3.0
POSITION_QUANTILES = {"pos_p50": 0.50, "pos_p75": 0.75, "pos_p90": 0.90, "pos_p95": 0.95, "pos_p99": 0.99}
GREATEST = float(np.finfo(np.float64).max)


def position_metrics(measured: Errors) -> dict[str, float]:
    """Mean, RMSE, spread, quantiles and their 95 % intervals, and the area under the distribution function up to 3 m.

    ``availability`` is the share of instants with a valid answer.
    """
    weight, position = measured.weights, measured.position
    valid, own = _finite(position, weight)
    centre = mean(valid, own)
    ordered = Ordered.of(position, weight)
    found = {name: ordered.quantile(share) for name, share in POSITION_QUANTILES.items()}
    return {
        "n": float(len(position)),
        "n_valid": float(len(valid)),
        "availability": mean(np.isfinite(position), weight),
        "pos_mean": centre,
        "pos_rmse": root_mean_square(valid, own),
        "pos_std": root_mean_square(valid - centre, own),
        "pos_min": float(valid.min()) if len(valid) else math.nan,
        "pos_max": float(valid.max()) if len(valid) else math.nan,
        "pos_auc": mean(np.maximum(0.0, 1.0 - position / AUC_RADIUS_M), weight),
        **found,
        **_quantile_intervals(measured, ordered, found),
    }


def _quantile_intervals(measured: Errors, ordered: Ordered, found: dict[str, float]) -> dict[str, float]:
    """``pos_p75_low`` and so on: 95 % intervals of the quantiles by binomial order statistics.

    ``n_eff`` is the effective sample size of the error, cut off at 3 m; each quantile's is that of being below it.
    """
    position = measured.position
    below = [position <= min(value, GREATEST) for value in found.values()]
    sizes = effective_sizes(np.array([np.minimum(position, AUC_RADIUS_M), *below]), measured.run)
    own, *others = sizes.tolist()
    scores = {"n_eff": own}
    for (name, share), samples in zip(POSITION_QUANTILES.items(), others, strict=True):
        low, high = order_shares(share, samples)
        scores |= {f"{name}_low": ordered.quantile(low), f"{name}_high": ordered.quantile(high)}
    return scores


def axis_metrics(measured: Errors) -> dict[str, float]:
    """What depends on the map's axes: absolute errors in x and y as the paper has them, bias and covariance.

    Where errors are Gaussian and alike in all directions, a mean of ``abs_x`` is 36 % below ``pos_mean``: never compare
    one with the other.
    """
    there = np.isfinite(measured.position)
    if not there.any():
        return dict.fromkeys(AXIS_IDS, math.nan)
    weight = None if measured.weights is None else measured.weights[there]
    dx, dy = measured.dx[there], measured.dy[there]
    abs_x, abs_y = np.abs(dx), np.abs(dy)
    bias_x, bias_y = mean(dx, weight), mean(dy, weight)
    from_x, from_y = dx - bias_x, dy - bias_y
    xx, xy, yy = mean(from_x * from_x, weight), mean(from_x * from_y, weight), mean(from_y * from_y, weight)
    of_x = mean(abs_x, weight), float(abs_x.max()), float(abs_x.min())
    of_y = mean(abs_y, weight), float(abs_y.max()), float(abs_y.min())
    drms = math.sqrt(xx + yy)
    return dict(zip(AXIS_IDS, (*of_x, *of_y, bias_x, bias_y, xx, xy, yy, drms, 2.0 * drms), strict=True))


AXIS_IDS = (
    *(f"abs_{axis}_{what}" for axis in "xy" for what in ("mean", "max", "min")),
    *("bias_x", "bias_y", "cov_xx", "cov_xy", "cov_yy", "drms", "2drms"),
)


def track_metrics(measured: Errors) -> dict[str, float]:
    """Errors along the true heading, forward positive, and across it, left positive: RMSE, bias, p95 of the size."""
    asked = np.isfinite(measured.true_heading)
    weight = None if measured.weights is None else measured.weights[asked]
    cos, sin = np.cos(measured.true_heading[asked]), np.sin(measured.true_heading[asked])
    dx, dy = measured.dx[asked], measured.dy[asked]
    scores = {}
    for name, error in (("along", cos * dx + sin * dy), ("cross", cos * dy - sin * dx)):
        valid, own = _finite(error, weight)
        size = np.where(np.isfinite(error), np.abs(error), np.inf)
        scores[f"{name}_rmse"] = root_mean_square(valid, own)
        scores[f"{name}_bias"] = mean(valid, own)
        scores[f"{name}_p95"] = quantile(size, 0.95, weight)
    return scores


def heading_metrics(measured: Errors) -> dict[str, float]:
    """Of absolute heading errors [rad]; all NaN for a method, or a truth, that never tells a heading."""
    known = ~np.isnan(measured.heading)
    asked = measured.heading[known]
    weight = None if measured.weights is None else measured.weights[known]
    valid, own = _finite(asked, weight)
    return {
        "head_mae": mean(valid, own),
        "head_rmse": root_mean_square(valid, own),
        "head_p95": quantile(asked, 0.95, weight) if len(valid) else math.nan,
    }


def _finite(values: Floats, weight: Floats | None) -> tuple[Floats, Floats | None]:
    """The finite values and their weights."""
    kept = np.isfinite(values)
    return values[kept], None if weight is None else weight[kept]
