"""Quality of the answers: all metrics by id, each a pure function of arrays, in metres, seconds and radians.

Coverage is part of the score. An instant without a valid answer counts as an infinite error in every quantile;
means and root mean squares cover the valid instants only and never rank alone. Nothing is aligned.
`docs/benchmark.md` lists the ids.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from benchmarks.metrics import consistency, convergence, drift, intervals, position, relative_pose
from benchmarks.metrics.consistency import CHI_SQUARE_95, Claimed, consistency_metrics, distribution_metrics
from benchmarks.metrics.convergence import dynamic_metrics
from benchmarks.metrics.drift import drift_metrics
from benchmarks.metrics.errors import Errors, errors
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.intervals import interval_metrics, quantile_intervals
from benchmarks.metrics.matching import match
from benchmarks.metrics.position import axis_metrics, heading_metrics, position_metrics, track_metrics
from benchmarks.metrics.relative_pose import trajectory_metrics
from fusion.quantiles import Ordered, quantile
from logs.truth import Instants

METRICS_VERSION = 12
"""Changes whenever a metric does, so that stored scores are not taken for current ones."""

METRICS = (
    *position.METRICS,
    *intervals.METRICS,
    *relative_pose.METRICS,
    *drift.METRICS,
    *consistency.METRICS,
    *convergence.METRICS,
)
"""The rows of `metrics`, and of what only the runner can add: while a fault lasts, without an answer."""

__all__ = [
    "CHI_SQUARE_95",
    "METRICS",
    "METRICS_VERSION",
    "Errors",
    "absolute_metrics",
    "errors",
    "for_json",
    "metrics",
    "metrics_of_lost",
    "quantile",
    "unanswered",
]


def metrics(measured: Errors) -> dict[str, float]:
    """All metrics by id, in m and rad; shares in [0, 1]. NaN where unknown, infinite where most is lost."""
    ordered, claimed = Ordered.of(measured.position, measured.weight), Claimed.of(measured)
    return {
        **_point_metrics(measured, ordered),
        **trajectory_metrics(measured),
        **drift_metrics(measured),
        **consistency_metrics(measured, claimed),
        **distribution_metrics(measured),
        **dynamic_metrics(measured),
        **interval_metrics(measured, ordered, claimed),
    }


def metrics_of_lost(scores: Mapping[str, float], silent: Mapping[str, float]) -> dict[str, float]:
    """Of the ``scores`` of an estimator that was lost those that count the instants without an answer too. Means over
    the answers it did give are NaN: they are what is NaN in ``silent``, the metrics of one that never answers.
    """
    return {name: value if not math.isnan(silent[name]) else math.nan for name, value in scores.items()}


def unanswered(instants: Instants) -> Errors:
    """The errors of an estimator that never answers."""
    return errors(instants, match(instants, Track.of_estimates(())))


def absolute_metrics(measured: Errors) -> dict[str, float]:
    """Those of position and heading alone, which are all that alignment changes."""
    ordered = Ordered.of(measured.position, measured.weight)
    return {**_point_metrics(measured, ordered), **quantile_intervals(measured, ordered)}


def _point_metrics(measured: Errors, ordered: Ordered) -> dict[str, float]:
    return {
        **position_metrics(measured, ordered),
        **axis_metrics(measured),
        **track_metrics(measured),
        **heading_metrics(measured),
    }


def for_json(scores: Mapping[str, float]) -> dict[str, float | None]:
    """JSON knows neither infinity nor NaN: both become None."""
    return {key: value if math.isfinite(value) else None for key, value in scores.items()}
