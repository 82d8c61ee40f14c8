"""One estimator as it is drawn: its updates turned into columns once, and its errors at the evaluation instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from benchmarks.cell import Score
from benchmarks.metrics.fates import FateColumns, fates_per_update
from benchmarks.metrics.matching import Answers, match
from benchmarks.review.columns import DrawnTrack, EstimateColumns
from benchmarks.review.events import Events, States, events, states
from benchmarks.runner.estimator_run import EstimatorRun
from benchmarks.runner.leaderboard import ranked
from fusion import Decision, Reason
from fusion.arrays import Floats, Whole
from fusion.output.colours import Colour, colour_of
from logs.run import Run
from logs.truth import Instants, evaluation_instants, wrap_angles

SHOWN = 6
"""Tracks that are switched on, the best ones: more cannot be told apart. The eye beside an entity shows the others."""


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
    """An estimator with its score. ``instants`` and ``answers`` belong together; they are
    None where there is nothing to compare: no truth, or an estimator that crashed.
    """

    estimator_run: EstimatorRun
    score: Score
    shown: bool
    instants: Instants | None
    answers: Answers | None

    @property
    def name(self) -> str:
        """Its name."""
        return self.estimator_run.name

    @property
    def ghost(self) -> bool:
        """Whether it shows what would have been, and is drawn thin."""
        return self.estimator_run.counterfactual_of is not None

    @property
    def colour(self) -> Colour:
        """A ghost has the colour of what it is a ghost of."""
        return colour_of(self.estimator_run.counterfactual_of or self.estimator_run.name)

    @cached_property
    def track(self) -> DrawnTrack:
        """The path."""
        return DrawnTrack.of_updates(self.estimator_run.final, self.estimates.valid)

    @cached_property
    def estimates(self) -> EstimateColumns:
        """What it said of itself."""
        return EstimateColumns.of_updates(self.estimator_run.final)

    @property
    def fates(self) -> FateColumns:
        """What became of the readings."""
        return self.estimator_run.fates

    @cached_property
    def fate_update(self) -> Whole:
        """The index in ``EstimatorRun.final`` of the update that each of them belongs to, (m,)."""
        return np.repeat(np.arange(len(self.estimator_run.final)), fates_per_update(self.estimator_run.final))

    @cached_property
    def states(self) -> States:
        """When its state changed."""
        return states(self.estimates, self.fates, self.fate_update)

    @cached_property
    def events(self) -> Events:
        """What happened to it."""
        return events(self.estimator_run.final, self.estimates, self.fates)

    @cached_property
    def gates(self) -> bool:
        """Whether it listens to the radio at all, so that there is a weight to show; of a ghost none is shown."""
        unheard = self.fates.met(Reason.KIND_NOT_CONSUMED) | self.fates.met(Decision.LATE)  # which may be of anything
        return not self.ghost and not bool(unheard.all())

    @cached_property
    def tells_nis(self) -> bool:
        """Whether any reading has an NIS."""
        return bool(np.isfinite(self.fates.nis).any())

    @cached_property
    def errors(self) -> SignedErrors | None:
        """Its errors and what it claims of them."""
        return None if self.instants is None or self.answers is None else signed_errors(self.instants, self.answers)

    @cached_property
    def claims(self) -> list[bool]:
        """Whether it ever claims a variance of x, y and heading."""
        return [False] * 3 if self.errors is None else [bool(np.isfinite(v).any()) for v in self.errors.variance.T]


def drawings(run: Run, estimator_runs: Sequence[EstimatorRun], scores: Sequence[Score]) -> list[Drawing]:
    """The estimators with their scores, one by one, the best first. A ghost is shown where its estimator is."""
    instants = None if run.truth is None else evaluation_instants(run.truth)
    by_name = {estimator_run.name: estimator_run for estimator_run in estimator_runs}
    ranking = [(by_name[score.estimator], score) for score in ranked(scores)]
    best = [estimator_run.name for estimator_run, _ in ranking if estimator_run.counterfactual_of is None][:SHOWN]
    drawn = []
    for estimator_run, score in ranking:
        shown = (estimator_run.counterfactual_of or estimator_run.name) in best
        compared = instants if score.errors is not None and estimator_run.error is None else None
        answers = None if compared is None else match(compared, estimator_run.track)
        drawn.append(Drawing(estimator_run, score, shown, compared, answers))
    return drawn
