"""Whether an estimator's predictions of its readings were as good as it claimed: a question that needs no truth."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from benchmarks.metrics.consistency import CHI_SQUARE_95
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.quantiles import mean
from benchmarks.metrics.track import Floats

NAMES = ("wifi", "ranges", "gyro", "ticks", "command", "odom")
"""Of `benchmarks.metrics.fates.KINDS`."""
LAGS = 10
"""Of the Ljung-Box test; a series of fewer than five times as many values is tested up to a fifth of its length."""


def innovation_metrics(fates: FateColumns) -> dict[str, float]:
    """Per kind of sensor: ``nis95_wifi``, the share of readings inside the 95 % of their own variance, and
    ``white_wifi``, the p-value of their whiteness (small: not white).

    Refused readings count: a gate would else make every filter look honest.
    """
    known = np.isfinite(fates.nis) & np.isfinite(fates.innovation) & (fates.innovation_variance > 0.0)
    scaled = fates.innovation / np.sqrt(np.where(known, fates.innovation_variance, 1.0))
    scores = {}
    for kind, name in sorted(enumerate(NAMES), key=lambda item: item[1]):
        own = known & (fates.kind == kind)
        if own.any():
            series = [scaled[own & (fates.anchor == anchor)] for anchor in np.unique(fates.anchor[own])]
            scores[f"nis95_{name}"] = mean(fates.nis[own] <= CHI_SQUARE_95[1])
            scores[f"white_{name}"] = ljung_box(series)
    return scores


def ljung_box(series: Iterable[Floats]) -> float:
    """P-value of the hypothesis that each of the series is white noise (Ljung & Box 1978); NaN if all are too short.

    The statistics of several series, one per anchor, are added, and so are their degrees of freedom.
    """
    from scipy.special import chdtrc

    statistic, degrees = 0.0, 0
    for values in series:
        count = len(values)
        lags = min(LAGS, count // 5)
        centred = values - mean(values)
        power = float(centred @ centred)
        if lags == 0 or not power > 0.0:
            continue
        degrees += lags
        for lag in range(1, lags + 1):
            correlation = float(centred[lag:] @ centred[:-lag]) / power
            statistic += count * (count + 2.0) * correlation**2 / (count - lag)
    return float(chdtrc(degrees, statistic)) if degrees else math.nan
