"""What the filters share that hold their belief as points: the spread of points, and a likelihood that forgives.

The likelihood of a residual is a mixture: (1 - share) of a normal density and a share of a uniform one that is
`OUTLIER_WIDTH` standard deviations wide, so no reading however far off can rule a place out (Thrun, Burgard & Fox
2005, section 6.3.1, who mix a measurement model in the same way).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fusion import (
    Covariance,
    Decision,
    Fate,
    Increment,
    ParameterError,
    Pose,
    Radio,
    Reason,
    Sighting,
    wrap_angle,
)
from fusion.radio import DistanceModel, PathLoss

Array = NDArray[np.float64]

OUTLIER_WIDTH = 20.0
"""Width of the uniform part of the mixture, in standard deviations of the reading."""
SHADOWING_LENGTH_M = 2.0
"""Path over which an anchor's shadowing stays alike [m], where the world does not tell."""
MOST_ALIKE, MOST_ALIKE_TOLD = 3.0, 20.0
"""How many neighbouring readings at most are taken to share one error, unless a parameter says otherwise: where the
path over which they do is a guess, and where the world tells it.
"""
DOUBTED_BELOW = 0.5
"""A reading counts as down-weighted when it is more likely an outlier than not."""


def square_root(covariance: Array) -> Array:
    """The symmetric square root of a positive semi-definite matrix (n, n); singular ones are welcome, and turning the
    frame turns the root with it, which Cholesky's factor does not.
    """
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def mixture(residual: Array, variance: Array | float, outlier_share: float) -> tuple[Array, Array]:
    """Likelihood of each residual up to a constant, and the probability that it is no outlier; any shape."""
    std = np.sqrt(variance)
    good = (1.0 - outlier_share) / math.sqrt(math.tau) * np.exp(-0.5 * np.square(residual / std)) / std
    likelihood = good + outlier_share / (OUTLIER_WIDTH * std)
    return likelihood, good / likelihood


def total_variance(sighting: Sighting) -> float:
    """Variance of a reading about its expectation: its own noise, and the errors it shares with other readings of its
    anchor, or of its kind; that of the kind grows with distance, which is taken from the reading itself.
    """
    model = sighting.model
    by_gain = float(model.by_gain(model.distance(sighting.value)))
    return float(sighting.variance + model.bias_std**2 + (by_gain * model.gain_std) ** 2)


def alike(path_m: float, length_m: float, most_alike: float) -> float:
    """How many readings of one anchor, ``path_m`` apart, share an error that lasts for ``length_m``: each then counts
    for as much less. ``most_alike`` bounds it, for a robot at rest would learn nothing more.

    >>> [alike(path_m, length_m=2.0, most_alike=3.0) for path_m in (0.0, 1.0, 5.0)]
    [3.0, 2.0, 1.0]
    """
    return min(max(length_m / max(path_m, 1e-9), 1.0), most_alike)


def sharing(model: DistanceModel, path_m: float, most_alike: float | None, length_m: float) -> float:
    """`alike` for the common error of an anchor's ``model``; ``length_m`` where the world does not tell its own,
    ``most_alike`` None: as much as is known of it.
    """
    told = model.bias_length_m
    bound = most_alike or (MOST_ALIKE if told is None else MOST_ALIKE_TOLD)
    return alike(path_m, told or length_m, bound)


def repeated_variance(sighting: Sighting, path_m: float, most_alike: float | None) -> float:
    """`total_variance` for an update by one of many readings, ``path_m`` after the one before. Shadowing belongs to the
    place (Gudmundson 1991), so what neighbouring signal strengths share is taken as many times as they are `alike`.
    """
    model = sighting.model
    times = sharing(model, path_m, most_alike, SHADOWING_LENGTH_M) if isinstance(model, PathLoss) else 1.0
    return total_variance(sighting) + (times - 1.0) * model.bias_std**2


def require_most_alike(name: str, most_alike: float | None) -> float | None:
    """``most_alike``; raises `ParameterError` where it is neither None nor a finite number of at least one."""
    if most_alike is not None and not 1.0 <= most_alike < math.inf:
        raise ParameterError(
            f"{name}: most_alike is {most_alike}; give a number from 1, which takes all as independent"
        )
    return most_alike


def moments(weights: Array, x: Array, y: Array, heading: Array) -> tuple[Pose, Covariance]:
    """Weighted mean pose and covariance of points whose shapes broadcast to that of ``weights``. The heading's mean is
    circular (Mardia & Jupp 2000, section 2.2), and its deviations are wrapped.
    """
    mean_x, mean_y = float(np.sum(weights * x)), float(np.sum(weights * y))
    mean_heading = math.atan2(float(np.sum(weights * np.sin(heading))), float(np.sum(weights * np.cos(heading))))
    dx, dy, turn = x - mean_x, y - mean_y, np.remainder(heading - mean_heading + np.pi, math.tau) - np.pi
    pairs = ((dx, dx), (dx, dy), (dx, turn), (dy, dy), (dy, turn), (turn, turn))
    spread = Covariance(*(float(np.sum(weights * (one * other))) for one, other in pairs))
    return Pose(mean_x, mean_y, wrap_angle(mean_heading)), spread


def carried(x: Array, y: Array, heading: Array, motion: Increment) -> tuple[Array, Array]:
    """Where points at (x, y) with ``heading`` come to by ``motion``, each in its own direction."""
    c, s = np.cos(heading), np.sin(heading)
    return x + c * motion.x - s * motion.y, y + s * motion.x + c * motion.y


def judged(
    scan: Radio,
    sighting: Sighting,
    pose: Pose,
    covariance: Covariance,
    antenna_m: tuple[float, float, float],
    weight: float,
) -> Fate:
    """The Fate of a reading of that ``weight``; its innovation is against the mean ``pose`` before the scan."""
    expected = sighting.expect(*pose, antenna_m)
    row = np.array([expected.by_x, expected.by_y, expected.by_heading])
    innovation = sighting.value - expected.value
    spread = float(row @ np.array(covariance.matrix) @ row) + total_variance(sighting)
    doubted = weight < DOUBTED_BELOW
    verdict = (Decision.DOWNWEIGHTED, Reason.ROBUST_LOSS) if doubted else (Decision.USED, Reason.OK)
    who = (scan.time_ns, scan.sensor, scan.seq, sighting.anchor.id)
    return Fate(*who, *verdict, weight, innovation, spread, innovation * innovation / spread)
