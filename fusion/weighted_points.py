"""Beliefs held as weighted points: their moments and motion, and a likelihood that is robust.

The likelihood of a residual is a mixture: (1 - share) of a normal density and a share of a uniform one that is
`OUTLIER_WIDTH` standard deviations wide, so no reading however far off can rule a place out (Thrun, Burgard & Fox
2005, section 6.3.1, who mix a measurement model in the same way).
"""

from __future__ import annotations

import math

import numpy as np

from fusion.arrays import Floats
from fusion.geometry import Covariance, Pose, wrap_angle
from fusion.motion import Increment

OUTLIER_WIDTH = 20.0
"""Width of the uniform part of the mixture, in standard deviations of the reading."""


def square_root(covariance: Floats) -> Floats:
    """The symmetric square root of a positive semi-definite matrix (n, n); singular ones are welcome, and turning the
    frame turns the root with it, which Cholesky's factor does not.
    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def mixture(residual: Floats, variance: Floats | float, outlier_share: float) -> tuple[Floats, Floats]:
    """Likelihood of each residual up to a constant, and the probability that it is no outlier; any shape."""
    std = np.sqrt(variance)
    good = (1.0 - outlier_share) / math.sqrt(math.tau) * np.exp(-0.5 * np.square(residual / std)) / std
    likelihood = good + outlier_share / (OUTLIER_WIDTH * std)
    return likelihood, good / likelihood


def moments(weights: Floats, x: Floats, y: Floats, heading: Floats) -> tuple[Pose, Covariance]:
    """Weighted mean pose and covariance of points whose shapes broadcast to that of ``weights``. The heading's mean is
    circular (Mardia & Jupp 2000, section 2.2), and its deviations are wrapped.
    """
    mean_x, mean_y = float(np.sum(weights * x)), float(np.sum(weights * y))
    mean_heading = math.atan2(float(np.sum(weights * np.sin(heading))), float(np.sum(weights * np.cos(heading))))
    dx, dy, turn = x - mean_x, y - mean_y, np.remainder(heading - mean_heading + np.pi, math.tau) - np.pi
    pairs = ((dx, dx), (dx, dy), (dx, turn), (dy, dy), (dy, turn), (turn, turn))
    spread = Covariance(*(float(np.sum(weights * (one * other))) for one, other in pairs))
    return Pose(mean_x, mean_y, wrap_angle(mean_heading)), spread


def carried(x: Floats, y: Floats, heading: Floats, motion: Increment) -> tuple[Floats, Floats]:
    """Points at (x, y) with ``heading`` after ``motion``, each in its own direction."""
    c, s = np.cos(heading), np.sin(heading)
    return x + c * motion.x - s * motion.y, y + s * motion.x + c * motion.y
