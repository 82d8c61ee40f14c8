"""Whether an estimator's predictions of its readings were as good as it claimed: a question that needs no truth."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.consistency import CHI_SQUARE_95
from benchmarks.metrics.effective_samples import effective_sizes, mean_chi_square_band
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.intervals import CEILING
from benchmarks.metrics.metric import Better, rows
from fusion.arrays import Floats
from fusion.quantiles import mean

NAMES = ("wifi", "ranges", "gyro", "ticks", "command", "odom")
"""Of `benchmarks.metrics.fates.KINDS`."""
LAGS = 10
"""Of the Ljung-Box test; a series of fewer than five times as many values is tested up to a fifth of its length."""
READINGS = "predicted readings"


def _each(ids: str) -> str:
    return " ".join(ids.replace("{}", name) for name in NAMES)


METRICS = (
    *rows(_each("nis_{}"), "1", Better.NEITHER, "mean NIS of the readings: 1 is honest, more is too certain", READINGS),
    *rows(_each("nis_{}_low nis_{}_high"), "1", Better.NEITHER, "band of an honest filter's mean NIS, 95 %", READINGS),
    *rows(_each("nis95_{}"), "share", Better.NEITHER, "share of readings inside 95 % of their variance", READINGS),
    *rows(_each("white_{}"), "1", Better.MORE, "p-value of their whiteness (Ljung & Box)", READINGS),
)
"""Of the functions below."""


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


class Banded(NamedTuple):
    """A mean, ideal 1, and the band that holds an honest filter's with 95 %."""

    mean: float
    low: float
    high: float

    @property
    def is_inside(self) -> bool:
        """Whether the filter may be honest."""
        return self.low <= self.mean <= self.high


def mean_nis(fates: FateColumns) -> dict[str, Banded]:
    """Of every kind of sensor whose readings the estimator predicts; refused readings count, as in `nis95_wifi`.

    Every reading is a scalar, so chi-square of one degree. The band takes the effective number of readings, by the
    correlation in time of each anchor's own; what anchors have in common at one time is not in it.
    """
    known, found = np.isfinite(fates.nis), {}
    for kind, name in enumerate(NAMES):
        own = np.flatnonzero(known & (fates.kind == kind))
        if len(own):
            own = own[np.argsort(fates.source[own], kind="stable")]
            nis, source = np.minimum(fates.nis[own], CEILING), fates.source[own]
            of_each_anchor = np.split(nis, np.flatnonzero(source[1:] != source[:-1]) + 1)
            samples = sum(float(effective_sizes(one[None])[0]) for one in of_each_anchor)
            found[name] = Banded(mean(nis), *mean_chi_square_band(1.0, samples))
    return found


def nis_metrics(fates: FateColumns) -> dict[str, float]:
    """`mean_nis` by id: ``nis_wifi``, and its band ``nis_wifi_low`` and ``nis_wifi_high``."""
    return {
        f"nis_{name}{end}": value
        for name, banded in mean_nis(fates).items()
        for end, value in zip(("", "_low", "_high"), banded, strict=True)
    }


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
