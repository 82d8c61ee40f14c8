"""Figures of accuracy: error distributions, paired differences, errors over time, cost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.metrics.score import quantile
from benchmarks.report.cell_links import nearest
from benchmarks.report.figure_panel import Panel, height_of, peaks
from benchmarks.report.report_data import ReportData
from benchmarks.runner.results import by_estimator, by_run, score_matrix
from fusion.output.figures import plain_colour

LINES = ("-", "--", "-.", ":")


LONGEST_LINE = 2000
"""Points a line is thinned to: a picture shows no more."""


LEAST_CM = 1.0
"""Lower end of logarithmic axes of errors, unless all are small: a run starts at its prior, with no error."""


LEADING = 200
"""Points of a line that lead to their moment: two pixels apart."""


def accuracy(data: ReportData) -> Iterator[Panel]:
    """Distribution, and run by run."""
    yield _cdf(data)
    yield _paired(data)


def _cdf(data: ReportData) -> Panel:
    """Distribution of errors; a curve ends at the availability, not at one."""
    panel = Panel("Error distribution, without faults", "position error, cm, log scale", "share of instants, %")
    for name in data.estimators:
        _distribution(panel, data, name)
    panel.log("x")
    panel.axes.set_xlim(left=_beginning(*panel.axes.get_xlim()))
    panel.axes.set_ylim(0.0, 100.0)
    panel.legend()
    return panel


def _distribution(panel: Panel, data: ReportData, name: str) -> None:
    """One curve. Each of its points is an instant of one of the runs, and leads there."""
    own = [series for (_, other), series in data.series.items() if other == name]
    error_m = np.concatenate([series.error_m for series in own] or [np.zeros(0)])
    time_s = np.concatenate([series.time_s for series in own] or [np.zeros(0)])
    cell = np.repeat(np.arange(len(own)), [len(series.time_s) for series in own])
    order = np.argsort(error_m, kind="stable")[: np.isfinite(error_m).sum()]
    if len(order) == 0:
        return
    error_cm, share = 100.0 * error_m[order], 100.0 * np.arange(1, len(order) + 1) / len(error_m)
    step = max(len(order) // LONGEST_LINE, 1)
    panel.axes.plot(error_cm[::step], share[::step], **_style(data, name))
    few = np.unique(np.linspace(0, len(order) - 1, LEADING).astype(int))
    for place, series in enumerate(own):
        at = few[cell[order[few]] == place]
        result = series.result
        caption = f"{name}, {result.cell.run.id}"
        panel.lead(error_cm[at], share[at], data.anchor(result), caption, time_s[order[at]])


def _paired(data: ReportData) -> Panel:
    """The ranking metric of every run, joined run by run: what the verdicts are made of."""
    grouped, names = by_estimator(data.results), data.estimators
    medians = [np.median(score_matrix(grouped[name], data.metric), axis=1) for name in names]
    scores = data.unit.factor * np.stack(medians, axis=1)
    panel = Panel("Run by run, without faults", f"{data.axis}, log scale", "", height_of(len(names)))
    for row in scores:
        panel.axes.plot(row, range(len(row)), color="0.7", linewidth=1, zorder=1)
    for place, name in enumerate(names):
        known = np.isfinite(scores[:, place])
        colour = plain_colour(data.use(name))
        panel.axes.scatter(scores[known, place], np.full(known.sum(), place), color=colour, s=24, zorder=2)
        for score, (run_id, cells) in zip(medians[place], by_run(grouped[name]).items(), strict=True):
            caption = f"{name}, {run_id}: {data.metric} {data.text(score)}"
            result = nearest(cells, data.metric, score)
            panel.lead(data.unit.factor * score, place, data.anchor(result), caption)
    panel.rows(names)
    panel.log("x")
    return panel


def over_time(data: ReportData) -> Iterator[Panel]:
    """Position error over time, run by run; gaps where there was no valid answer."""
    for place, run_id in enumerate(data.scored_runs):
        panel = Panel(run_id, "time since the start, s", "position error, cm, log scale")
        for name in data.estimators:
            if (series := data.series.get((run_id, name))) is not None:
                time_s, error_cm = series.time_s, 100.0 * np.where(series.answers.valid, series.error_m, np.nan)
                few, fewer = peaks(error_cm, LONGEST_LINE), peaks(error_cm, LEADING)
                panel.axes.plot(time_s[few], error_cm[few], linewidth=1, **_style(data, name))
                anchor, caption = data.anchor(series.result), f"{name}, {run_id}"
                panel.lead(time_s[fewer], error_cm[fewer], anchor, caption, time_s[fewer])
        panel.log("y")
        panel.axes.set_ylim(bottom=_beginning(*panel.axes.get_ylim()))
        if place == 0:
            panel.legend()
        yield panel


def cost(data: ReportData) -> Iterator[Panel]:
    """Accuracy against processor time, where `fusion bench time` has measured it: lower left is better."""
    grouped, x = by_estimator(data.results), "processor time per measurement, µs, log scale"
    panel = Panel("Accuracy against cost", x, f"{data.axis}, log scale")
    for rank, name in enumerate(data.estimators, 1):
        score = quantile(np.median(score_matrix(grouped[name], data.metric), axis=1), 0.5)
        if name in data.timing and np.isfinite(score):
            place = (data.timing[name], data.unit.factor * score)
            panel.axes.scatter(*place, color=plain_colour(data.use(name)), s=30, label=f"{rank} {name}")
            panel.axes.annotate(str(rank), place, textcoords="offset points", xytext=(4, 3), fontsize=8)
            caption = f"{name}: {data.metric} {data.text(score)}, {place[0]:.0f} µs"
            panel.lead(*place, data.anchor(nearest(grouped[name], data.metric, score)), caption)
    panel.log("x")
    panel.log("y")
    if panel.axes.collections:
        panel.legend()
        yield panel


def _beginning(low: float, high: float) -> float:
    """Lower end of an axis of errors that would reach from ``low`` to ``high`` [cm].

    >>> _beginning(1e-7, 300.0), _beginning(20.0, 300.0), _beginning(1e-7, 0.5)
    (1.0, 20.0, 0.005)
    """
    return max(low, min(LEAST_CM, high / 100.0))


def _style(data: ReportData, name: str) -> dict[str, Any]:
    """The colour of the estimator, and a line that distinguishes it from its neighbours without colour."""
    line = LINES[data.estimators.index(name) % len(LINES)]
    return {"color": plain_colour(data.use(name)), "linestyle": line, "label": name}
