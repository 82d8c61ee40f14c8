"""The moments at which estimators erred most, and the commands that show them in Rerun."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.peaks import peaks
from benchmarks.report.material import Material, Series
from benchmarks.review.frame import Frame
from benchmarks.review.invocation import review_command
from benchmarks.runner.definition import Contestant, RunSource
from benchmarks.runner.source import place_of, scenario_of
from fusion.values import seconds

PER_CELL = 1


class Moment(NamedTuple):
    """A local maximum of the position error [m] of one cell, ``at_s`` after the start of its run."""

    run: RunSource
    contestant: Contestant
    at_s: float
    error_m: float

    def command(self, folder: Path) -> str:
        """How to look at it, for a suite in ``folder``; a run that is no log of ours yet is made one first."""
        made, log = as_log(self.run, folder)
        shown = review_command(log, self.contestant.use, self.at_s, params=self.contestant.params)
        return f"{shlex.join(made)} && {shown}" if made else shown


def worst_moments(material: Material, count: int = 10) -> list[Moment]:
    """The ``count`` worst of the shown runs."""
    found = [moment for series in material.series.values() for moment in _of_cell(material, series)]
    return sorted(found, key=lambda moment: -moment.error_m)[:count]


def _of_cell(material: Material, series: Series) -> list[Moment]:
    error_m = np.where(np.isfinite(series.error_m), series.error_m, -1.0)
    cell, time_ns = series.result.cell, series.instants.time_ns
    start_ns = Frame.around(material.run(cell.run.id)).start_ns
    return [
        Moment(cell.run, cell.contestant, seconds(int(time_ns[k]) - start_ns), float(error_m[k]))
        for k in peaks(time_ns, error_m, PER_CELL)
        if error_m[k] >= 0.0
    ]


def as_log(run: RunSource, folder: Path) -> tuple[list[str], Path]:
    """The words that make a log of ours of a run, none where it is one, and where that log is."""
    made = Path(f"{run.id}.mcap")
    if run.scenario is not None:
        words = ["fusion", "simulate", str(scenario_of(run.scenario, folder)), "--seed", str(run.seed)]
        cut = [] if run.duration_s is None else ["--duration", f"{run.duration_s:g}"]
        return [*words, *cut, "-o", str(made)], made
    place = place_of(run, folder)
    if run.world is None:
        return [], place
    topics = [word for role, topic in run.topics.items() for word in ("--topic", f"{role}={topic}")]
    pose = ["--truth-to-map", *(f"{value:g}" for value in run.truth_to_map)]
    bag = ["fusion", "import", "rosbag", str(place), "--world", str(folder / run.world)]
    return [*bag, *topics, *pose, "-o", str(made)], made
