"""Errors that are left when the estimate may be moved onto the truth: never without saying by how much.

Alignment hides the error of absolute localization, so the raw score is the headline, and an aligned one stands beside
its transform and the ratio of both. Consistency is judged on raw estimates only: alignment would move covariances too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.matching import Answers
from fusion import ParameterError, Pose
from fusion.errors import did_you_mean
from logs.truth import Instants

ALIGNMENTS = ("se2", "origin")
STATIC = 1e-9
"""A direction that explains less of the spread of both tracks than this is none."""


class Aligned(NamedTuple):
    """The moved answers, without covariances, and the pose of the estimate's frame in the map that moved them."""

    answers: Answers
    map_from_estimate: Pose


def align(instants: Instants, answers: Answers, how: str) -> Aligned | None:
    """Move ``answers`` by the least-squares transform ``se2`` or so that the first poses meet (``origin``).

    None when they are not alignable: nothing valid, a run that stood still, or an origin without headings.
    """
    if how not in ALIGNMENTS:
        raise ParameterError(f"alignment {how!r} does not exist; {did_you_mean(how, ALIGNMENTS)}")
    found = _se2(instants, answers) if how == "se2" else _origin(instants, answers)
    return None if found is None else Aligned(_moved(answers, found), found)


def _se2(instants: Instants, answers: Answers) -> Pose | None:
    """The least over SE(2) of the sum of ‖R p̂ + t - p‖²: yaw = atan2(Σ p̂ × p, Σ p̂ · p) of centred points.

    The planar case of Arun, Huang & Blostein (1987); exact on a straight line, where Umeyama's in space is not.
    """
    if not answers.valid.any():
        return None
    true = (instants.x + 1j * instants.y)[answers.valid]
    estimated = (answers.x + 1j * answers.y)[answers.valid]
    from_true, from_estimated = true - true.mean(), estimated - estimated.mean()
    turn = complex(np.vdot(from_estimated, from_true))
    spread = float((np.abs(from_true) ** 2 + np.abs(from_estimated) ** 2).sum())
    if abs(turn) <= STATIC * spread:
        return None
    shift = complex(true.mean() - estimated.mean() * turn / abs(turn))
    return Pose(shift.real, shift.imag, math.atan2(turn.imag, turn.real))


def _origin(instants: Instants, answers: Answers) -> Pose | None:
    """T₀ T̂₀⁻¹ of the first instant where both poses are known whole."""
    whole = np.flatnonzero(answers.valid & np.isfinite(answers.heading) & np.isfinite(instants.heading))
    if len(whole) == 0:
        return None
    first = whole[0]
    true = Pose(float(instants.x[first]), float(instants.y[first]), float(instants.heading[first]))
    estimated = Pose(float(answers.x[first]), float(answers.y[first]), float(answers.heading[first]))
    return true.compose(estimated.inverse())


def _moved(answers: Answers, map_from_estimate: Pose) -> Answers:
    cos, sin = math.cos(map_from_estimate.heading), math.sin(map_from_estimate.heading)
    return answers._replace(
        x=map_from_estimate.x + cos * answers.x - sin * answers.y,
        y=map_from_estimate.y + sin * answers.x + cos * answers.y,
        heading=answers.heading + map_from_estimate.heading,
        covariance=np.full_like(answers.covariance, np.nan),
    )
