"""Fates: of readings that the host refuses, of single readings judged by a filter, of whole position fixes."""

from __future__ import annotations

import math

import numpy as np

from fusion.correlated_error import total_variance
from fusion.geometry import Covariance, Pose
from fusion.radio_reading import RadioReading
from fusion.robot import Robot
from fusion.values import Decision, Fate, Measurement, Radio, Reason


def fate(measurement: Measurement, anchor: str, decision: Decision, reason: Reason) -> Fate:
    """A Fate of weight zero: this reading moved nothing."""
    return Fate(measurement.time_ns, measurement.sensor, measurement.seq, anchor, decision, reason, 0.0)


def refused(measurement: Measurement, decision: Decision, reason: Reason) -> tuple[Fate, ...]:
    """The Fates of a measurement none of whose readings could be used: one per anchor, or one without."""
    anchors = [r.anchor for r in measurement.readings] if isinstance(measurement, Radio) else [""]
    return tuple(fate(measurement, anchor, decision, reason) for anchor in anchors)


def unusable(measurement: Measurement, reason: Reason) -> tuple[Fate, ...]:
    """`refused` because the readings themselves are unusable."""
    return refused(measurement, Decision.UNUSABLE, reason)


def fix_fates(
    scan: Radio,
    seen: tuple[RadioReading, ...],
    robot: Robot,
    belief: tuple[Pose, Covariance | None] | None,
    verdict: tuple[Decision, Reason],
    weight: float,
) -> tuple[Fate, ...]:
    """One Fate per anchor of a fix that was weighed in as a whole, each with the reading's own innovation.

    ``belief`` is what was expected before the scan: None where nothing was, its covariance None where none is claimed.
    """
    fates = []
    for item in seen:
        who = (scan.time_ns, scan.sensor, scan.seq, item.anchor.id)
        numbers: tuple[float | None, ...] = (None, None, None)
        if belief is not None:
            pose, covariance = belief
            expected = item.expect(*pose, robot.antenna_m)
            innovation = item.value - expected.value
            numbers = (innovation, None, None)
            if covariance is not None:
                row = np.array([expected.by_x, expected.by_y, expected.by_heading])
                spread = float(row @ np.array(covariance.matrix) @ row)
                variance = spread + item.variance + item.model.bias_std**2
                numbers = (innovation, variance, innovation**2 / variance)
        fates.append(Fate(*who, *verdict, weight, *numbers))
    return tuple(fates)


DOUBTED_BELOW = 0.5
"""A reading counts as down-weighted when it is more likely an outlier than not."""


def judged(
    scan: Radio,
    reading: RadioReading,
    pose: Pose,
    covariance: Covariance,
    antenna_m: tuple[float, float, float],
    weight: float,
) -> Fate:
    """The Fate of a reading of that ``weight``; its innovation is against the mean ``pose`` before the scan."""
    expected = reading.expect(*pose, antenna_m)
    row = np.array([expected.by_x, expected.by_y, expected.by_heading])
    innovation = reading.value - expected.value
    spread = float(row @ np.array(covariance.matrix) @ row) + total_variance(reading)
    doubted = weight < DOUBTED_BELOW
    verdict = (Decision.DOWNWEIGHTED, Reason.ROBUST_LOSS) if doubted else (Decision.USED, Reason.OK)
    who = (scan.time_ns, scan.sensor, scan.seq, reading.anchor.id)
    return Fate(*who, *verdict, weight, innovation, spread, innovation * innovation / spread)


def chi_square_gate(probability: float) -> float:
    """The quantile of chi-square with one degree of freedom: the square of the normal's two-sided quantile.

    >>> round(chi_square_gate(0.99), 4)
    6.6349
    """
    from statistics import NormalDist

    return math.inf if probability == 1.0 else NormalDist().inv_cdf(0.5 + 0.5 * probability) ** 2
