"""How far the answers were from the truth: the columns that every metric is computed from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.claims import judge
from benchmarks.metrics.instants import Answers, Instants, wrap_angles
from benchmarks.metrics.track import Floats, Whole


class Errors(NamedTuple):
    """Errors at the evaluation instants, all (n,): what every metric is computed from, and what runs are pooled by.

    ``position`` [m]: infinite without a valid answer. ``heading`` [rad], absolute: NaN where the truth has none,
    infinite where only the answer has none. ``nees``: squared Mahalanobis distance of the error, over ``dimension``
    3, or 2 where a heading is missing; ``nees_2d`` of the position alone; both NaN where no covariance was claimed.

    ``dx``, ``dy`` [m], map frame, and ``turn`` [rad]: answer minus truth, NaN where there is none. ``x``, ``y``,
    ``true_heading``: the truth. ``nll``, ``nll_2d`` [nat] and ``energy`` [m]: see `benchmarks.metrics.claims.Claims`.
    ``age_s``, ``since_fix_s``: see `Answers`. ``weight``: how often the instant counts in means and quantiles of
    errors, None where all count alike. ``run`` numbers the runs that were pooled; within each, time rises.
    """

    position: Floats
    heading: Floats
    nees: Floats
    dimension: Whole
    nees_2d: Floats
    time_ns: Whole
    dx: Floats
    dy: Floats
    turn: Floats
    x: Floats
    y: Floats
    true_heading: Floats
    nll: Floats
    nll_2d: Floats
    energy: Floats
    age_s: Floats
    since_fix_s: Floats
    weight: Floats | None
    run: Whole


def errors(instants: Instants, answers: Answers, weight: Floats | None = None) -> Errors:
    """The errors of ``answers``, which belong to ``instants`` one by one; ``weight`` (n,) None: all count alike."""
    valid = answers.valid
    dx = np.where(valid, answers.x - instants.x, np.nan)
    dy = np.where(valid, answers.y - instants.y, np.nan)
    turn = np.where(valid, wrap_angles(answers.heading - instants.heading), np.nan)
    claims = judge(dx, dy, turn, answers.covariance)
    whole = np.isfinite(turn)
    return Errors(
        position=np.where(valid, np.abs(dx + 1j * dy), np.inf),
        heading=np.where(np.isnan(instants.heading), np.nan, np.where(whole, np.abs(turn), np.inf)),
        nees=np.where(whole, claims.nees, claims.nees_2d),
        dimension=np.where(whole, 3, 2),
        nees_2d=claims.nees_2d,
        time_ns=instants.time_ns,
        dx=dx,
        dy=dy,
        turn=turn,
        x=instants.x,
        y=instants.y,
        true_heading=instants.heading,
        nll=claims.nll,
        nll_2d=claims.nll_2d,
        energy=claims.energy,
        age_s=answers.age_s,
        since_fix_s=answers.since_fix_s,
        weight=weight,
        run=np.zeros(len(dx), dtype=np.int64),
    )


def pool(parts: Sequence[Errors]) -> Errors:
    """All instants of all parts together, each part a run of its own."""
    weighed = any(part.weight is not None for part in parts)
    alike = [part._replace(weight=_weight(part)) for part in parts]
    together = Errors(*(np.concatenate(columns) for columns in zip(*alike, strict=True)))
    offsets = np.cumsum([0, *(int(part.run.max(initial=-1)) + 1 for part in parts[:-1])])
    runs = [part.run + offset for part, offset in zip(parts, offsets, strict=True)]
    return together._replace(run=np.concatenate(runs), weight=together.weight if weighed else None)


def _weight(part: Errors) -> Floats:
    return np.ones(len(part.position)) if part.weight is None else part.weight
