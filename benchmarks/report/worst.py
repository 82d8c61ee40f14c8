"""The moments at which estimators erred most, and the commands that show them in Rerun."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.metrics.peaks import peaks
from benchmarks.report.material import Material, Series
from benchmarks.runner.definition import RunSource

PER_CELL = 1


class Moment(NamedTuple):
    """A local maximum of the position error [m] of one cell, ``time_s`` after the start of its truth."""

    run: RunSource
    contestant: str
    use: str
    time_s: float
    error_m: float


def worst_moments(material: Material, count: int = 10) -> list[Moment]:
    """The ``count`` worst of the shown runs."""
    found = [moment for series in material.series.values() for moment in _of_cell(series)]
    return sorted(found, key=lambda moment: -moment.error_m)[:count]


def _of_cell(series: Series) -> list[Moment]:
    error_m = np.where(np.isfinite(series.error_m), series.error_m, -1.0)
    cell = series.result.cell
    who = (cell.run, cell.contestant.id, cell.contestant.use)
    places = peaks(series.instants.time_ns, error_m, PER_CELL)
    return [Moment(*who, float(series.time_s[k]), float(error_m[k])) for k in places if error_m[k] >= 0.0]


def command(moment: Moment) -> str:
    """How to look at it; a simulated run is made first."""
    run = moment.run
    if run.mcap is not None:
        return f"fusion review {run.mcap} --estimators {moment.use} --at {moment.time_s:.1f}"
    made = f"fusion simulate {run.scenario} --seed {run.seed} -o {run.id}.mcap"
    return f"{made} && fusion review {run.id}.mcap --estimators {moment.use} --at {moment.time_s:.1f}"
