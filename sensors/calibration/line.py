"""The line that radio readings follow, fitted robustly, with an interval that knows about correlation over the floor.

    reading = level of the anchor + gain * g(d)

For signal strength the gain is n and g = -10 log10(d / d0), zero below d0; for ranges the gain is the scale and g = d.

Each place counts once for each anchor, by the median of its readings. The estimator is Huber's M-estimator (1964, k =
1.345) with the normalised median absolute deviation for its scale, by iterated weights. What is left of neighbouring
places is alike (Gudmundson 1991: correlation exp(-distance / length)), so the covariance of the estimate comes from
Huber's pseudo-values with a length, and a share of what is not correlated, found by restricted maximum likelihood.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion import LogError
from fusion.arrays import Floats, Whole
from sensors.calibration.correlation import blocks, find_correlation, likelihood
from sensors.calibration.held_out import Interval
from sensors.calibration.spots import NORMAL, Spots

HUBER = 1.345
"""Residuals beyond so many standard deviations count linearly: 95 % efficient where all is Gaussian."""
ITERATIONS = 50
LEAST_PLACES = 4
LEAST_SPREAD = 1e-3


class Estimate(NamedTuple):
    """Gain and levels of the anchors, NaN where none was heard."""

    gain: float
    levels: Floats

    @property
    def level(self) -> float:
        """The mean of the anchors' levels."""
        return float(np.nanmean(self.levels))

    @classmethod
    def of(cls, told: Spots, anchors: int) -> Estimate:
        """The numbers of `fit_line` alone, for what is fitted many times."""
        design, heard = _design(told)
        numbers, _ = _huber(design, told.value)
        return cls(float(numbers[0]), _levels(numbers, heard, anchors))


class Line(NamedTuple):
    """The fit. ``levels`` of the anchors, NaN where none was heard; ``covariance`` of (gain, levels heard);
    ``place_std``: how far spots scatter about the line; ``length_m`` and ``share``: the correlation over the floor and
    what is not correlated; ``effective``: how many independent spots the spots are worth.
    """

    gain: float
    levels: Floats
    covariance: Floats
    place_std: float
    length_m: float
    share: float
    effective: float
    spots: int

    @property
    def freedom(self) -> float:
        """Degrees for Student's t: the independent spots, since it is the correlation that the least is known of."""
        return max(self.effective, 1.0)

    @property
    def level(self) -> float:
        """The mean of the anchors' levels."""
        return float(np.nanmean(self.levels))

    @property
    def level_std_between(self) -> float:
        """How far the anchors' levels lie apart, without what their own uncertainty explains."""
        heard = self.levels[np.isfinite(self.levels)]
        if len(heard) < 2:
            return 0.0
        own = self.covariance[1:, 1:]
        noise = float(np.trace(own) - own.sum() / len(heard)) / (len(heard) - 1)
        return math.sqrt(max(float(heard.var(ddof=1)) - noise, 0.0))

    def gain_interval(self) -> Interval:
        """Of the gain."""
        return Interval.of(self.gain, math.sqrt(self.covariance[0, 0]), self.freedom)

    def level_interval(self, anchor: int | None = None) -> Interval:
        """Of an anchor's level, or of the mean of all."""
        heard = np.flatnonzero(np.isfinite(self.levels))
        picks = np.full(len(heard), 1.0 / len(heard)) if anchor is None else (heard == anchor).astype(float)
        variance = float(picks @ self.covariance[1:, 1:] @ picks)
        return Interval.of(
            self.level if anchor is None else float(self.levels[anchor]), math.sqrt(variance), self.freedom
        )


def fit_line(told: Spots, anchors: int, correlation: tuple[float, float] | None = None) -> Line:
    """All anchors together, one gain and a level each; ``correlation`` (length [m], share) None: found.

    Raises `LogError` where there are too few places, or all are at one distance.
    """
    design, heard = _design(told)
    numbers, scale = _huber(design, told.value)
    left = (told.value - design @ numbers) / scale
    inside = float(np.mean(np.abs(left) <= HUBER))
    pseudo = scale * np.clip(left, -HUBER, HUBER) / max(inside, 0.1)
    length, share = correlation or find_correlation(told, design, pseudo)
    parts = blocks(told, length, share)
    variance = likelihood(parts, design, pseudo)[1]
    bread = np.linalg.inv(design.T @ design)
    meat = sum(design[rows].T @ alike @ design[rows] for rows, alike in parts)
    levels, covariance = _levels(numbers, heard, anchors), variance * bread @ meat @ bread
    effective = sum(len(alike) ** 2 / float(alike.sum()) for _, alike in parts)
    return Line(float(numbers[0]), levels, covariance, scale, length, share, effective, len(told.value))


def _design(told: Spots) -> tuple[Floats, Whole]:
    """Columns of the gain and of each anchor heard (n, 1 + m), and the anchors (m,)."""
    heard = np.unique(told.anchor)
    design = np.column_stack([told.gain, *(told.anchor == anchor for anchor in heard)]).astype(np.float64)
    check(told, design)
    return design, heard


def _levels(numbers: Floats, heard: Whole, anchors: int) -> Floats:
    levels = np.full(anchors, np.nan)
    levels[heard] = numbers[1:]
    return levels


def check(told: Spots, design: Floats) -> None:
    """Refuse what cannot tell the gain from the levels."""
    places, distances = len(np.unique(told.place)), told.gain - (design[:, 1:] @ _means(told, design))
    if places < LEAST_PLACES or len(told.value) < design.shape[1] + 2:
        raise LogError(f"readings at {places} places are too few; stand at {LEAST_PLACES} or more, near and far")
    if float(np.abs(distances).max()) < LEAST_SPREAD:
        raise LogError(
            "all readings of each anchor are at one distance, where level and slope cannot be told apart; go nearer to "
            "the anchors, and farther away"
        )


def _means(told: Spots, design: Floats) -> Floats:
    """Mean gain by anchor."""
    return np.asarray((design[:, 1:].T @ told.gain) / design[:, 1:].sum(axis=0))


def _huber(design: Floats, values: Floats) -> tuple[Floats, float]:
    """Estimate and scale, by iterated weights from least squares on; an exact fit has a tiny scale, never none."""
    numbers: Floats = np.asarray(np.linalg.lstsq(design, values, rcond=None)[0], dtype=np.float64)
    fair = math.sqrt(len(values) / max(len(values) - design.shape[1], 1))
    scale = 1e-9
    for _ in range(ITERATIONS):
        left = values - design @ numbers
        scale = max(NORMAL * fair * float(np.median(np.abs(left))), 1e-9)
        root = np.sqrt(HUBER / np.maximum(np.abs(left) / scale, HUBER))
        changed: Floats = np.asarray(
            np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0], dtype=np.float64
        )
        if float(np.abs(design @ (changed - numbers)).max()) < 1e-9 + 1e-6 * scale:
            return changed, scale
        numbers = changed
    return numbers, scale
