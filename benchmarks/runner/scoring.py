"""Score of an estimator's track against the truth of its run: the one judgement behind benches, suites and reviews."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from benchmarks.faults.fault import Fault
from benchmarks.faults.inject import outages
from benchmarks.metrics.convergence import fault_metrics
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.families import all_metrics
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.innovations import innovation_metrics, nis_metrics
from benchmarks.metrics.matching import availability, match, meet
from benchmarks.metrics.score import Errors, errors, metrics_of_lost, unanswered
from benchmarks.runner.reference import Reference
from benchmarks.runner.suite import Evaluation

LEAST_AVAILABILITY = 0.5
"""An estimator with valid answers at no more than this share of instants counts as diverged: its median is infinite."""
STATUSES = ("ok", "unscored", "diverged", "crashed", "timeout", "oom")
"""Ends of a cell, best first; ``unscored``: the log holds no ground truth."""
ALIVE = ("ok", "unscored")
"""Statuses of a cell that was not lost."""
USUAL = Evaluation()


class End(NamedTuple):
    """End of an estimator: one of `STATUSES`, and the reason of a loss."""

    status: str
    error: str | None = None


@dataclass(frozen=True)
class Score:
    """The score of one estimator on one run. ``errors`` is None without truth. ``metrics`` by id: those of
    `benchmarks.metrics.catalogue`; of an estimator that was lost, what is left of them (`metrics_of_lost`).
    """

    end: End
    errors: Errors | None
    metrics: dict[str, float]

    @property
    def status(self) -> str:
        """One of `STATUSES`."""
        return self.end.status

    @property
    def worst_at_ns(self) -> int | None:
        """Time of the greatest position error; None where no error counts."""
        if self.errors is None or self.status not in ALIVE:
            return None
        error_m = np.where(np.isfinite(self.errors.position), self.errors.position, -1.0)
        if len(error_m) == 0 or error_m.max() < 0.0:
            return None
        return int(self.errors.time_ns[error_m.argmax()])


def score(
    track: Track,
    fates: FateColumns,
    reference: Reference,
    *,
    crash: End | None = None,
    rules: Evaluation = USUAL,
    faults: Sequence[Fault] = (),
) -> Score:
    """The score of ``track``, by the ``rules`` of a suite, with how it did while its ``faults`` lasted.

    ``crash``: how an estimator ended that did not survive. Half a run is no result: its ``track`` is empty.
    """
    own = {} if crash or track.flaw else {**innovation_metrics(fates), **nis_metrics(fates)}
    if len(reference.instants) == 0:
        return Score(crash or end_of(track, math.nan), None, {"availability": availability(track), **own})
    measured, metrics = _judge(track, reference, rules, faults)
    end = crash or end_of(track, metrics["availability"])
    if end.status not in ALIVE:
        metrics = _left(metrics, reference, rules, faults)
    return Score(end, measured, {**metrics, **own})


def end_of(track: Track, available: float) -> End:
    """End of an estimator that did not crash, from the share of instants with a valid answer; NaN without truth."""
    if track.flaw:
        return End("diverged", track.flaw)
    if math.isnan(available):
        return End("unscored")
    if available <= LEAST_AVAILABILITY:
        return End("diverged", f"only {100.0 * available:.1f} % of the instants have a valid answer")
    return End("ok")


def _judge(
    track: Track, reference: Reference, rules: Evaluation, faults: Sequence[Fault]
) -> tuple[Errors, dict[str, float]]:
    """Errors, and all metrics of them."""
    if rules.reading == "interp":
        met = meet(reference.truth, track, gap_s=rules.gap_s)
        measured = errors(met.instants, met.answers, met.weight)
        # Only there do the errors not show by themselves how much of the run had an answer.
        return measured, {**_metrics(measured, reference, faults), "availability": met.availability}
    measured = errors(reference.instants, match(reference.instants, track, max_age_s=rules.max_age_s))
    return measured, _metrics(measured, reference, faults)


def _left(
    metrics: dict[str, float], reference: Reference, rules: Evaluation, faults: Sequence[Fault]
) -> dict[str, float]:
    """Metrics that are left of an estimator that was lost: `metrics_of_lost`, and its availability. At the estimate's
    own stamps no metric counts an instant without an answer, so there nothing else is left.
    """
    silent = _metrics(unanswered(reference.instants), reference, faults)
    left = silent if rules.reading == "interp" else metrics_of_lost(metrics, silent)
    return {**left, "availability": metrics["availability"]}


def _metrics(measured: Errors, reference: Reference, faults: Sequence[Fault]) -> dict[str, float]:
    metrics = all_metrics(measured)
    return metrics | fault_metrics(measured, reference.begin_ns, outages(faults)) if faults else metrics
