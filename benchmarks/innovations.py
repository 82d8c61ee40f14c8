"""Whether an estimator's predictions of its readings were as good as it claimed: a question that needs no truth."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from benchmarks.consistency import CHI_SQUARE_95
from benchmarks.instants import Floats
from benchmarks.quantiles import mean
from fusion import Gyro, Measurement, Ranges, Update, WheelTicks, WifiScan

KINDS: dict[type[Measurement], str] = {WifiScan: "wifi", Ranges: "ranges", Gyro: "gyro", WheelTicks: "ticks"}
LAGS = 10
"""Of the Ljung-Box test; a series of fewer than five times as many values is tested up to a fifth of its length."""


def innovation_metrics(updates: Iterable[Update]) -> dict[str, float]:
    """Of the last word on each measurement, in time order, per kind of sensor: ``nis95_wifi``, the share of readings
    inside the 95 % of their own variance, and ``white_wifi``, the p-value of their whiteness (small: not white).

    Refused readings count: a gate would else make every filter look honest.
    """
    by_kind: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for update in updates:
        kind = KINDS.get(type(update.measurement))
        for fate in update.fates:
            if kind and fate.nis is not None and fate.innovation is not None and fate.innovation_variance:
                scaled = fate.innovation / math.sqrt(fate.innovation_variance)
                by_kind.setdefault(kind, {}).setdefault(fate.anchor, []).append((fate.nis, scaled))
    scores = {}
    for kind, by_anchor in sorted(by_kind.items()):
        series = [np.array(rows) for rows in by_anchor.values()]
        scores[f"nis95_{kind}"] = mean(np.concatenate(series)[:, 0] <= CHI_SQUARE_95[1])
        scores[f"white_{kind}"] = ljung_box([rows[:, 1] for rows in series])
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
