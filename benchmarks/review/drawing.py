"""One estimator as it is drawn: its updates turned into columns once, and its errors at the evaluation instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.catalogue import COST
from benchmarks.metrics.fates import FateColumns, fates_per_update
from benchmarks.metrics.matching import Answers, match
from benchmarks.review.columns import DrawnTrack, EstimateColumns
from benchmarks.review.events import Events, States, events, states
from benchmarks.review.folding import Reviewed
from benchmarks.runner.leaderboard import Entry, rank
from benchmarks.runner.reference import Reference
from benchmarks.runner.scoring import Score
from fusion import Decision, Reason, Update
from fusion.arrays import Floats, Whole
from fusion.output.colours import Colour, colour_of
from logs.run import Run
from logs.truth import Instants, wrap_angles

SHOWN = 6
"""Tracks that are switched on, the best ones; the eye beside an entity shows the others."""


class SignedErrors(NamedTuple):
    """Estimate minus truth, x, y and heading (n, 3) [m, m, rad], and what is claimed of its variance (n, 3); NaN where
    there is no valid answer, or no claim.
    """

    error: Floats
    variance: Floats


def signed_errors(instants: Instants, answers: Answers) -> SignedErrors:
    """Of ``answers``, which belong to ``instants`` one by one."""
    turn = wrap_angles(answers.heading - instants.heading)
    error = np.column_stack([answers.x - instants.x, answers.y - instants.y, turn])
    variance = answers.covariance[:, [0, 3, 5]]
    known = answers.valid[:, None] & np.isfinite(error)
    return SignedErrors(np.where(known, error, np.nan), np.where(known & np.isfinite(variance), variance, np.nan))


@dataclass(frozen=True)
class Drawing:
    """An estimator as it is drawn. ``instants`` and ``answers`` belong together; they are None where there is nothing
    to compare: no truth, or an estimator that crashed.
    """

    reviewed: Reviewed
    shown: bool
    instants: Instants | None
    answers: Answers | None

    @property
    def name(self) -> str:
        """Its name."""
        return self.reviewed.name

    @property
    def score(self) -> Score:
        """Its score."""
        return self.reviewed.score

    @property
    def final(self) -> tuple[Update, ...]:
        """Its final updates, in time order."""
        return self.reviewed.made.final

    @property
    def is_counterfactual(self) -> bool:
        """True where it is of a run that did not happen, and is drawn thin."""
        return self.reviewed.counterfactual_of is not None

    @property
    def colour(self) -> Colour:
        """A counterfactual has the colour of its estimator."""
        return colour_of(self.reviewed.counterfactual_of or self.name)

    @cached_property
    def track(self) -> DrawnTrack:
        """The path."""
        return DrawnTrack.of_updates(self.final, self.estimates.valid)

    @cached_property
    def estimates(self) -> EstimateColumns:
        """Its estimates, as columns."""
        return EstimateColumns.of_updates(self.final)

    @property
    def fates(self) -> FateColumns:
        """The final fates of the readings."""
        return self.reviewed.made.fates

    @cached_property
    def fate_update(self) -> Whole:
        """The index in `Drawing.final` of the update that each of them belongs to, (m,)."""
        return np.repeat(np.arange(len(self.final)), fates_per_update(self.final))

    @cached_property
    def states(self) -> States:
        """Its changes of state."""
        return states(self.estimates, self.fates, self.fate_update)

    @cached_property
    def events(self) -> Events:
        """Its events."""
        return events(self.final, self.estimates, self.fates)

    @cached_property
    def gates(self) -> bool:
        """True where it uses radio at all, so that there is a weight to show; of a counterfactual none is shown."""
        unused = self.fates.met(Reason.KIND_NOT_CONSUMED) | self.fates.met(Decision.LATE)  # which may be of anything
        return not self.is_counterfactual and not bool(unused.all())

    @cached_property
    def has_nis(self) -> bool:
        """True where any reading has an NIS."""
        return bool(np.isfinite(self.fates.nis).any())

    @cached_property
    def errors(self) -> SignedErrors | None:
        """Its errors and what it claims of them."""
        return None if self.instants is None or self.answers is None else signed_errors(self.instants, self.answers)

    @cached_property
    def has_variance(self) -> bool:
        """True where it ever claims a variance of x, y or heading."""
        return self.errors is not None and bool(np.isfinite(self.errors.variance).any())


def drawings(run: Run, reviewed: Sequence[Reviewed]) -> list[Drawing]:
    """The estimators with their scores, the best first. A counterfactual is shown where its estimator is."""
    instants = Reference.of(run).instants
    ranking = sorted(reviewed, key=lambda one: rank(entry_of(one)))
    best = [one.name for one in ranking if one.counterfactual_of is None][:SHOWN]
    return [_drawing(one, instants, shown=(one.counterfactual_of or one.name) in best) for one in ranking]


def _drawing(reviewed: Reviewed, instants: Instants, *, shown: bool) -> Drawing:
    made, scored = reviewed.made, reviewed.score
    if scored.errors is None or made.error is not None:
        return Drawing(reviewed, shown, None, None)
    return Drawing(reviewed, shown, instants, match(instants, made.track))


def entry_of(reviewed: Reviewed) -> Entry:
    """The row of an estimator in the table of scores."""
    cost = {} if reviewed.cost_s is None else {COST.id: reviewed.cost_s}
    return Entry(reviewed.name, (reviewed.score.status,), {**reviewed.score.metrics, **cost})
