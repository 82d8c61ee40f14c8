"""The track of a cell against the truth of its run, by the rules of its suite."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.faults.inject import outages
from benchmarks.metrics.convergence import fault_metrics
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.matching import match, meet
from benchmarks.metrics.score import Errors, errors, metrics, metrics_of_lost, unanswered
from benchmarks.runner.plan import Cell, read_faults
from benchmarks.runner.reference import Reference
from benchmarks.runner.suite import CLEAN
from fusion.values import seconds


class Judged(NamedTuple):
    """The errors of a cell, and all its metrics by id."""

    errors: Errors
    metrics: dict[str, float]

    def worst_at_s(self, start_ns: int | None) -> float | None:
        """When the position error was greatest, since the start of the run; None where there was no answer at all."""
        error_m = np.where(np.isfinite(self.errors.position), self.errors.position, -1.0)
        if start_ns is None or len(error_m) == 0 or error_m.max() < 0.0:
            return None
        return seconds(int(self.errors.time_ns[error_m.argmax()]) - start_ns)


def judge(cell: Cell, track: Track, reference: Reference) -> Judged | None:
    """None without truth."""
    rules = cell.evaluation
    if len(reference.truth) == 0:
        return None
    if rules.reading == "interp":
        met = meet(reference.truth, track, gap_s=rules.gap_s)
        measured = errors(met.instants, met.answers, met.weight)
        # Only there do the errors not say by themselves how much of the run had an answer.
        return Judged(measured, {**_metrics(cell, reference, measured), "availability": met.availability})
    measured = errors(reference.instants, match(reference.instants, track, max_age_s=rules.max_age_s))
    return Judged(measured, _metrics(cell, reference, measured))


def metrics_if_lost(cell: Cell, reference: Reference, judged: Judged) -> dict[str, float]:
    """What is left of the metrics of a cell that was lost: `metrics_of_lost`, and its availability. At the estimate's
    own stamps no metric counts an instant without an answer, so there nothing else is left.
    """
    silent = _metrics(cell, reference, unanswered(reference.instants))
    left = silent if cell.evaluation.reading == "interp" else metrics_of_lost(judged.metrics, silent)
    return {**left, "availability": judged.metrics["availability"]}


def _metrics(cell: Cell, reference: Reference, measured: Errors) -> dict[str, float]:
    """All metrics, with how the cell did while its faults lasted, and after."""
    found = metrics(measured)
    if cell.fault.id != CLEAN:
        found |= fault_metrics(measured, reference.begin_ns, outages(read_faults(cell.fault)))
    return found
