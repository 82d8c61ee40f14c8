"""The line that radio readings follow, fitted robustly, with an interval that knows about correlation over the floor.

    reading = level of the anchor + gain * g(d)

For signal strength the gain is n and g = -10 log10(d / d0), zero below d0; for ranges the gain is the scale and g = d.

Each place counts once for each anchor, by the median of its readings. The estimator is Huber's M-estimator (1964, k =
1.345) with the normalised median absolute deviation for its scale, by iterated weights. Residuals of neighbouring
places are correlated (Gudmundson 1991: exp(-distance / length)), so the covariance of the estimate comes from
Huber's pseudo-values with a length, and a share of uncorrelated variance, estimated by restricted maximum likelihood.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion import LogError
from fusion.arrays import Floats, Whole
from sensors.calibration.correlation import blocks, find_correlation, likelihood
from sensors.calibration.held_out import Interval
from sensors.calibration.place_medians import NORMAL, PlaceMedians

HUBER = 1.345
"""Residuals beyond so many standard deviations count linearly: 95 % efficient where all is Gaussian."""
ITERATIONS = 50
LEAST_PLACES = 4
LEAST_SPREAD = 1e-3


class Estimate(NamedTuple):
    """Gain and levels of the anchors, NaN where none was received."""

    gain: float
    levels: Floats

    @property
    def level(self) -> float:
        """The mean of the anchors' levels."""
        return float(np.nanmean(self.levels))

    @classmethod
    def of(cls, medians: PlaceMedians, anchors: int) -> Estimate:
        """The numbers of `fit_line` alone, for what is fitted many times."""
        design, received = _design(medians)
        numbers, _ = _huber(design, medians.value)
        return cls(float(numbers[0]), _levels(numbers, received, anchors))


class Line(NamedTuple):
    """The fit. ``levels`` of the anchors, NaN where none was received; ``covariance`` of (gain, levels received);
    ``place_std``: standard deviation of the medians about the line; ``length_m`` and ``share``: the correlation over
    the floor and the uncorrelated share; ``effective``: number of independent medians of the same weight.
    """

    gain: float
    levels: Floats
    covariance: Floats
    place_std: float
    length_m: float
    share: float
    effective: float
    medians: int

    @property
    def freedom(self) -> float:
        """Degrees for Student's t: the independent medians, since the correlation is the least known."""
        return max(self.effective, 1.0)

    @property
    def level(self) -> float:
        """The mean of the anchors' levels."""
        return float(np.nanmean(self.levels))

    @property
    def level_std_between(self) -> float:
        """Standard deviation between the anchors' levels, without their own uncertainty."""
        received = self.levels[np.isfinite(self.levels)]
        if len(received) < 2:
            return 0.0
        own = self.covariance[1:, 1:]
        noise = float(np.trace(own) - own.sum() / len(received)) / (len(received) - 1)
        return math.sqrt(max(float(received.var(ddof=1)) - noise, 0.0))

    def gain_interval(self) -> Interval:
        """Of the gain."""
        return Interval.of(self.gain, math.sqrt(self.covariance[0, 0]), self.freedom)

    def level_interval(self, anchor: int | None = None) -> Interval:
        """Of an anchor's level, or of the mean of all."""
        received = np.flatnonzero(np.isfinite(self.levels))
        picks = np.full(len(received), 1.0 / len(received)) if anchor is None else (received == anchor).astype(float)
        variance = float(picks @ self.covariance[1:, 1:] @ picks)
        return Interval.of(
            self.level if anchor is None else float(self.levels[anchor]), math.sqrt(variance), self.freedom
        )


def fit_line(medians: PlaceMedians, anchors: int, correlation: tuple[float, float] | None = None) -> Line:
    """All anchors together, one gain and a level each; ``correlation`` (length [m], share) None: estimated.

    Raises `LogError` where there are too few places, or all are at one distance.
    """
    design, received = _design(medians)
    numbers, scale = _huber(design, medians.value)
    left = (medians.value - design @ numbers) / scale
    inside = float(np.mean(np.abs(left) <= HUBER))
    pseudo = scale * np.clip(left, -HUBER, HUBER) / max(inside, 0.1)
    length, share = correlation or find_correlation(medians, design, pseudo)
    parts = blocks(medians, length, share)
    variance = likelihood(parts, design, pseudo)[1]
    bread = np.linalg.inv(design.T @ design)
    meat = sum(design[rows].T @ alike @ design[rows] for rows, alike in parts)
    levels, covariance = _levels(numbers, received, anchors), variance * bread @ meat @ bread
    effective = sum(len(alike) ** 2 / float(alike.sum()) for _, alike in parts)
    return Line(float(numbers[0]), levels, covariance, scale, length, share, effective, len(medians.value))


def _design(medians: PlaceMedians) -> tuple[Floats, Whole]:
    """Columns of the gain and of each anchor received (n, 1 + m), and the anchors (m,)."""
    received = np.unique(medians.anchor)
    design = np.column_stack([medians.gain, *(medians.anchor == anchor for anchor in received)]).astype(np.float64)
    check(medians, design)
    return design, received


def _levels(numbers: Floats, received: Whole, anchors: int) -> Floats:
    levels = np.full(anchors, np.nan)
    levels[received] = numbers[1:]
    return levels


def check(medians: PlaceMedians, design: Floats) -> None:
    """Refuse medians that do not separate the gain from the levels; raises `LogError`."""
    places, distances = len(np.unique(medians.place)), medians.gain - (design[:, 1:] @ _means(medians, design))
    if places < LEAST_PLACES or len(medians.value) < design.shape[1] + 2:
        raise LogError(f"readings at {places} places are too few; stand at {LEAST_PLACES} or more, near and far")
    if float(np.abs(distances).max()) < LEAST_SPREAD:
        raise LogError(
            "all readings of each anchor are at one distance, where level and slope cannot be separated; go nearer to "
            "the anchors, and farther away"
        )


def _means(medians: PlaceMedians, design: Floats) -> Floats:
    """Mean gain by anchor."""
    return np.asarray((design[:, 1:].T @ medians.gain) / design[:, 1:].sum(axis=0))


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
