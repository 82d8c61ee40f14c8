"""Errors of the answers against the truth: the columns that every metric is computed from."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.metrics.matching import Answers
from benchmarks.metrics.proper_scores import judge
from fusion.arrays import Floats, Whole, points
from logs.truth import Instants, wrap_angles


class Errors(NamedTuple):
    """Errors at the evaluation instants, all (n,): what every metric is computed from.

    ``instants``: the truth. ``position`` [m]: infinite without a valid
    answer. ``heading`` [rad], absolute: NaN where the truth has none, infinite where only the answer has none.
    ``nees``: squared Mahalanobis distance of the error, over ``dimension`` 3, or 2 where a heading is missing;
    ``nees_2d`` of the position alone; both NaN where no covariance was claimed.

    ``dx``, ``dy`` [m], map frame, and ``turn`` [rad]: answer minus truth, NaN where there is none. ``nll``, ``nll_2d``
    [nat] and ``energy`` [m]: see `benchmarks.metrics.claims.Claims`. ``age_s``, ``since_fix_s``: see `Answers`.
    ``weight``: how often the instant counts in means and quantiles of errors, None where all count alike.
    """

    instants: Instants
    position: Floats
    heading: Floats
    nees: Floats
    dimension: Whole
    nees_2d: Floats
    dx: Floats
    dy: Floats
    turn: Floats
    nll: Floats
    nll_2d: Floats
    energy: Floats
    age_s: Floats
    since_fix_s: Floats
    weight: Floats | None

    @property
    def time_ns(self) -> Whole:
        """When each instant was."""
        return self.instants.time_ns


def errors(instants: Instants, answers: Answers, weight: Floats | None = None) -> Errors:
    """The errors of ``answers``, which belong to ``instants`` one by one; ``weight`` (n,) None: all count alike."""
    valid = answers.valid
    dx, dy = answers.x - instants.x, answers.y - instants.y
    turn = wrap_angles(answers.heading - instants.heading)
    if not valid.all():
        dx, dy, turn = (np.where(valid, column, np.nan) for column in (dx, dy, turn))
    position, heading = np.abs(points(dx, dy)), np.abs(turn)
    claims = judge(dx, dy, turn, answers.covariance)
    nees, whole = claims.nees, np.isfinite(turn)
    if not whole.all():
        position = np.where(valid, position, np.inf)
        heading = np.where(whole, heading, np.where(np.isnan(instants.heading), np.nan, np.inf))
        nees = np.where(whole, nees, claims.nees_2d)
    return Errors(
        instants=instants,
        position=position,
        heading=heading,
        nees=nees,
        dimension=np.where(whole, 3, 2),
        nees_2d=claims.nees_2d,
        dx=dx,
        dy=dy,
        turn=turn,
        nll=claims.nll,
        nll_2d=claims.nll_2d,
        energy=claims.energy,
        age_s=answers.age_s,
        since_fix_s=answers.since_fix_s,
        weight=weight,
    )
