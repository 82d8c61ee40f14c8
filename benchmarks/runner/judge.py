"""The track of a cell against the truth of its run, by the rules of its suite."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.faults.faults import outages
from benchmarks.metrics.dynamics import fault_metrics
from benchmarks.metrics.instants import evaluation_instants, match
from benchmarks.metrics.interpolation import meet
from benchmarks.metrics.score import Errors, errors, metrics
from benchmarks.metrics.track import Track
from benchmarks.prior import begin_ns
from benchmarks.runner.definition import CLEAN
from benchmarks.runner.plan import Cell, read_faults
from benchmarks.runner.source import open_run
from fusion.values import seconds
from logs.run import Run


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


def judge(cell: Cell, track: Track) -> Judged | None:
    """None without truth."""
    run = open_run(cell.run, cell.folder)
    if run.truth is None or len(run.truth) == 0:
        return None
    rules = cell.evaluation
    if rules.reading == "interp":
        met = meet(run.truth, track, gap_s=rules.gap_s)
        measured = errors(met.instants, met.answers, met.weight)
        # Only there do the errors not say by themselves how much of the run had an answer.
        return Judged(measured, {**_metrics(cell, run, measured), "availability": met.availability})
    instants = evaluation_instants(run.truth, hz=rules.hz, gap_s=rules.gap_s)
    measured = errors(instants, match(instants, track, max_age_s=rules.max_age_s))
    return Judged(measured, _metrics(cell, run, measured))


def _metrics(cell: Cell, run: Run, measured: Errors) -> dict[str, float]:
    """All metrics, with how the cell did while its faults lasted, and after."""
    found = metrics(measured)
    if cell.fault.id != CLEAN:
        found |= fault_metrics(measured, begin_ns(run.measurements), outages(read_faults(cell.fault)))
    return found
