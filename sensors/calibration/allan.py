"""Allan deviation of a sensor at rest: its noise, and the stability of its bias.

Overlapping estimator of IEEE Std 952-1997, annex C (Riley 2008, section 5.2.4). White noise falls with the square root
of the averaging time; where the curve is lowest, averaging longer helps no more.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion.arrays import Floats
from sensors.calibration.held_out import Interval

BIAS_INSTABILITY = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Lowest point of the curve over the bias instability: 0.664."""
LEAST_SAMPLES = 50
PER_DECADE = 8
LEAST_WINDOWS = 9
"""An averaging time that fits into the record fewer times is not shown: its deviation is off by a quarter or more."""


class Allan(NamedTuple):
    """The curve (n,): averaging times [s], deviations, and their own standard deviations, roughly; and its numbers.

    ``noise``: density of the white noise [unit s / sqrt(s)], for a gyro in rad/s: angle random walk [rad/sqrt(s)].
    ``bias_instability`` [unit]; ``is_lowest`` False: the curve still falls at its end, and it is less than this.
    """

    tau_s: Floats
    deviation: Floats
    std: Floats
    noise: Interval
    bias_instability: float
    is_lowest: bool


def allan_deviation(rates: Floats, sizes: Floats) -> Floats:
    """Overlapping Allan deviation of evenly spaced ``rates`` (n,), averaged over each of ``sizes`` samples (m,)."""
    sums = np.concatenate([[0.0], np.cumsum(rates)])
    deviations = []
    for size in sizes.astype(int):
        means = (sums[size:] - sums[:-size]) / size
        deviations.append(math.sqrt(0.5 * float(np.mean(np.square(means[size:] - means[:-size])))))
    return np.array(deviations)


def allan(rates: Floats, period_s: float) -> Allan | None:
    """The curve of a record at rest; None of fewer than `LEAST_SAMPLES` samples."""
    count = len(rates)
    if count < LEAST_SAMPLES:
        return None
    largest = count // LEAST_WINDOWS
    steps = np.geomspace(1, largest, max(int(PER_DECADE * math.log10(largest)), 2))
    sizes = np.unique(np.round(steps)).astype(np.float64)
    deviation, tau = allan_deviation(rates - rates.mean(), sizes), sizes * period_s
    share = 1.0 / np.sqrt(2.0 * (count / sizes - 1.0))
    lowest = int(np.argmin(deviation))
    return Allan(
        tau,
        deviation,
        share * deviation,
        _noise(sizes, tau, deviation, count),
        float(deviation[lowest]) / BIAS_INSTABILITY,
        lowest < len(sizes) - 1,
    )


def _noise(sizes: Floats, tau_s: Floats, deviation: Floats, count: int) -> Interval:
    """From the shortest averages, where white noise alone counts; of one sample each the deviation is off by about
    sqrt(3 / 4n), for the differences of white noise are correlated (Riley 2008, section 5.3).
    """
    value = float(deviation[0] * math.sqrt(tau_s[0]))
    return Interval.of(value, value * math.sqrt(0.75 / (count / float(sizes[0]))), count - 1.0)
