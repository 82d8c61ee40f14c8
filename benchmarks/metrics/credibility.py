"""Whether an estimator claims the errors that it really makes: a question that several seeds of one run can answer.

One run shows a single error at each instant. Seeds, of a random estimator or of a random fault, show its actual mean
square there, and the claim is held against that; a method that no seed changes has nothing to be judged by.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.metrics.errors import Errors
from fusion.arrays import Floats
from fusion.quantiles import mean

LEAST_SEEDS = 5
"""Of fewer, the mean square of three numbers is hardly known."""
SINGULAR = 1e-9
"""Errors that are this much alike, as a determinant of correlations, do not fill their dimensions."""


def credibility_metrics(runs: Sequence[Sequence[Errors]]) -> dict[str, float]:
    """``nci`` and ``incl`` [dB], means of 10 ∣log₁₀(ν / ν*)∣ and 10 log₁₀(ν / ν*) (Li & Zhao 2006), over all ``runs``,
    each the errors of its seeds at the same instants.

    ν is the NEES by the claimed covariance, ν* that by the actual mean square error matrix over the seeds. Credible is
    0; ``incl`` above 0 is too certain, below too modest. Of k seeds an honest Gaussian claim reads about -4.3 / k dB:
    10 / ln 10 (ψ(k / 2) - ln(k / 2)). Where some seed has no heading, of the position alone; NaN where nothing can
    be stated: without claims, with fewer than `LEAST_SEEDS`, and of errors that no seed changes.
    """
    found = [_log_ratios(seeds) for seeds in runs if len(seeds) >= LEAST_SEEDS]
    ratios = 10.0 * np.concatenate(found) if found else np.empty(0)
    return {"nci": mean(np.abs(ratios)), "incl": mean(ratios)}


def _log_ratios(seeds: Sequence[Errors]) -> Floats:
    """log₁₀(ν / ν*) of every seed at every instant that can be judged, (m,)."""
    error = np.array([(one.dx, one.dy, one.turn) for one in seeds])
    whole = np.isfinite(error[:, 2]).all(axis=0)
    of_pose = _ratios(error[..., whole], np.array([one.nees[whole] for one in seeds]))
    of_position = _ratios(error[:, :2, ~whole], np.array([one.nees_2d[~whole] for one in seeds]))
    return np.asarray(np.log10(np.concatenate([of_pose, of_position])))


def _ratios(error: Floats, claimed: Floats) -> Floats:
    """ν / ν* of errors (seeds, dimension, n) with the NEES ``claimed`` (seeds, n), where all seeds have one; (m,)."""
    error = error.transpose(2, 0, 1)
    square = error.transpose(0, 2, 1) @ error / error.shape[1]
    std = np.sqrt(np.diagonal(square, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = np.linalg.det(square / (std[:, :, None] * std[:, None, :]))
    kept = (alike > SINGULAR) & (claimed > 0.0).all(axis=0)
    error, square = error[kept], square[kept]
    actual = (error * np.linalg.solve(square, error.transpose(0, 2, 1)).transpose(0, 2, 1)).sum(axis=2)
    return np.asarray((claimed[:, kept].T / actual).ravel())
