"""Sensitivity to the parameters that a suite has a grid of: each value against the default, run by run.

A value that is chosen on a run and scored on it flatters itself, so the runs for tuning and those for testing stand
apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

import fusion
from benchmarks.metrics.score import quantile
from benchmarks.report.cell_links import link, nearest
from benchmarks.report.figure_panel import Panel
from benchmarks.report.report_data import ReportData
from benchmarks.runner.results import Result, by_run, score_matrix
from benchmarks.runner.suite import CLEAN, TEST, TUNE, EstimatorSpec
from benchmarks.statistics.paired_tests import log_ratios, mean_interval
from fusion.arrays import Flags, Floats
from fusion.output.figures import plain_colour, plain_ticks
from fusion.output.tables import Table
from fusion.plugins import parameters

WITHOUT_TUNE = (
    'No run of this suite has split = "tune". Whoever takes the best value from here has chosen it on the runs that it '
    "is scored on: it will do worse on others."
)


class Sweep(NamedTuple):
    """One parameter of a grid. ``cells``: of every value those of every run, seeds and the grid's other parameters
    among them; ``scores`` (values, runs): their medians. ``compared_with``: the place of the default, or of the first
    value where the default is not in the grid.
    """

    estimator: str
    use: str
    parameter: str
    values: Sequence[object]
    compared_with: int
    has_default: bool
    cells: Sequence[Sequence[Sequence[Result]]]
    scores: Floats
    is_test: Flags

    @property
    def log_ratios(self) -> Floats:
        """(values, runs): below 0 where a value is better than what it is compared with."""
        return np.array([log_ratios(row, self.scores[self.compared_with]) for row in self.scores])

    @property
    def ratios(self) -> Floats:
        """The same as multiples, NaN where one of the two was lost."""
        return np.exp(np.where(np.isfinite(self.log_ratios), self.log_ratios, np.nan))

    @property
    def judged(self) -> Flags:
        """The runs that the means are over: for tests, or all where none is."""
        return self.is_test if self.is_test.any() else ~self.is_test

    @property
    def intervals(self) -> tuple[Floats, Floats, Floats]:
        """Of every value the geometric mean over the judged runs, and the ends of its paired t interval."""
        intervals = [mean_interval(row[np.isfinite(row)]) for row in self.log_ratios[:, self.judged]]
        mean, low, high = (np.exp(np.clip([float(one[k]) for one in intervals], -50.0, 50.0)) for k in range(3))
        return mean, low, high

    def name(self, place: int) -> str:
        """A value, and whether it is the default."""
        return f"{self.values[place]}{' (default)' if self.has_default and place == self.compared_with else ''}"


def sweeps(data: ReportData) -> list[Sweep]:
    """Every parameter that has several values; empty for a suite without a grid."""
    families: dict[tuple[str, str], list[EstimatorSpec]] = {}
    for one in data.suite.estimators:
        if one.grid:
            families.setdefault((one.id.partition("[")[0], one.use), []).append(one)
    return [
        _sweep(data, estimator, own, parameter, values)
        for (estimator, _), own in families.items()
        for parameter, values in own[0].grid.items()
        if len(values) > 1
    ]


def _sweep(
    data: ReportData, estimator: str, own: Sequence[EstimatorSpec], parameter: str, values: Sequence[object]
) -> Sweep:
    cells = [_cells(data, [one.id for one in own if one.params[parameter] == value]) for value in values]
    scores = [[quantile(score_matrix(few, data.metric).ravel(), 0.5) for few in row] for row in cells]
    default = parameters(fusion.load(own[0].use))[parameter].default
    known = [place for place, value in enumerate(values) if value == default]
    is_test = np.array([few[0].cell.run.split == TEST for few in cells[0]])
    place, has_default = (known or [0])[0], bool(known)
    return Sweep(estimator, own[0].use, parameter, values, place, has_default, cells, np.array(scores), is_test)


def _cells(data: ReportData, ids: Sequence[str]) -> list[list[Result]]:
    """Run by run the cells without faults of these estimators."""
    own = [one for one in data.results if one.cell.fault.id == CLEAN and one.cell.estimator.id in ids]
    return list(by_run(own).values())


def sensitivity(data: ReportData, swept: Sequence[Sweep]) -> Table:
    """Each value as a multiple of what it is compared with: geometric mean over runs with its paired t interval. It
    leads to the run in which the value makes the greatest difference.
    """
    rows = [
        (
            sweep.estimator,
            sweep.parameter,
            sweep.name(place),
            *(_linked(data, sweep, place, of) for of in (~sweep.is_test, sweep.is_test)),
        )
        for sweep in swept
        for place in range(len(sweep.values))
    ]
    title = f"Parameters: {data.metric} as a multiple of the default's (else of the first value's), [95 %]"
    return Table(title, ("estimator", "parameter", "value", "tune runs", "test runs"), tuple(rows))


def _linked(data: ReportData, sweep: Sweep, place: int, of: Flags) -> str:
    text = _ratio_text(sweep, place, of)
    if text == "–":
        return text
    return link(data, text, _cell(data, sweep, place, _farthest(sweep, place, of)))


def _ratio_text(sweep: Sweep, place: int, of: Flags) -> str:
    ratios = sweep.log_ratios[place, of]
    known = ratios[np.isfinite(ratios)]
    if place == sweep.compared_with or len(known) == 0:
        return "–"
    mean, low, high = (math.exp(min(float(value), 50.0)) for value in mean_interval(known)[:3])
    interval = f" [{low:.2f}, {high:.2f}]" if len(known) > 1 else ""
    gone = f" ({len(ratios) - len(known)} lost)" if len(known) < len(ratios) else ""
    return f"{mean:.2f}×{interval}{gone}"


def advice(swept: Sequence[Sweep]) -> Iterator[str]:
    """Conclusions: the best value of the tune runs, and its score on the others."""
    for sweep in swept:
        if sweep.is_test.all():
            yield WITHOUT_TUNE
            return
        best = int(np.argmin([quantile(row, 0.5) for row in sweep.log_ratios[:, ~sweep.is_test]]))
        chosen = f"{sweep.estimator}: on the {TUNE} runs {sweep.parameter} = {sweep.name(best)} is best"
        if best == sweep.compared_with:
            yield f"{chosen}."
        else:
            worth = _ratio_text(sweep, best, sweep.is_test)
            yield f"{chosen}; on the {TEST} runs it scores {worth} what {sweep.name(sweep.compared_with)} does."


def curves(data: ReportData, swept: Sequence[Sweep]) -> Iterator[Panel]:
    """One panel per parameter."""
    for sweep in swept:
        title, y = f"{sweep.estimator}: {sweep.parameter}", f"ratio of {data.metric}, log scale"
        panel = Panel(title, "value; dotted: the default" if sweep.has_default else "value", y)
        _draw(panel, sweep)
        _lead(panel, data, sweep)
        yield panel


def _draw(panel: Panel, sweep: Sweep) -> None:
    """A grey line per run, dashed where it is for tuning; the mean of the test runs with its interval."""
    axes, places = panel.axes, np.arange(len(sweep.values))
    for run, is_test in enumerate(sweep.is_test.tolist()):
        axes.plot(places, sweep.ratios[:, run], color="0.7", linewidth=1, linestyle="-" if is_test else "--", zorder=1)
    mean, low, high = sweep.intervals
    colour = plain_colour(sweep.use)
    if sweep.judged.sum() > 1:
        axes.vlines(places, low, high, color=colour, linewidth=2, zorder=2)
    axes.plot(places, mean, color=colour, marker="o", linewidth=2, zorder=3)
    if sweep.has_default:
        axes.axvline(sweep.compared_with, color="0.4", linestyle=":", linewidth=1, zorder=0)
    axes.set_yscale("log")
    bottom, top = axes.get_ylim()
    axes.set_ylim(min(bottom, 0.8), max(top, 1.25))
    plain_ticks(axes.yaxis, (1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 7.0, 8.0, 9.0))
    axes.set_xticks(places, [str(value) for value in sweep.values])


def _lead(panel: Panel, data: ReportData, sweep: Sweep) -> None:
    """Runs to their own cells, means to the run in which the value makes the greatest difference."""
    for place in range(len(sweep.values)):
        value = f"{sweep.estimator}, {sweep.parameter} = {sweep.name(place)}"
        for run, ratio in enumerate(sweep.ratios[place]):
            cell = _cell(data, sweep, place, run)
            panel.lead(place, ratio, data.anchor(cell), f"{value}, {cell.cell.run.id}: {ratio:.2f}×")
        cell = _cell(data, sweep, place, _farthest(sweep, place, sweep.judged))
        caption = f"{value}: {_ratio_text(sweep, place, sweep.judged)}, farthest in {cell.cell.run.id}"
        panel.lead(place, sweep.intervals[0][place], data.anchor(cell), caption)


def _farthest(sweep: Sweep, place: int, of: Flags) -> int:
    """The run in which a value makes the greatest difference."""
    return int(np.where(of, np.abs(sweep.log_ratios[place]), -1.0).argmax())


def _cell(data: ReportData, sweep: Sweep, place: int, run: int) -> Result:
    return nearest(sweep.cells[place][run], data.metric, sweep.scores[place, run])
