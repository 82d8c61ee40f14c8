"""Maps of the best estimator: its track over the floor, coloured by its error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.limits.anchor_placement import Grid, Readings, default_step, error_map
from benchmarks.report.figure_panel import Panel, peaks
from benchmarks.report.report_data import ReportData, Series, radio_of
from fusion import Bounds
from logs.run import Run

MOST_POINTS = 2000
"""A track is thinned to so many."""
LEADING = 400
"""Points of a track that lead to their moment."""


def maps(data: ReportData) -> Iterator[Panel]:
    """One for each shown run that the best estimator has answered in."""
    best = data.estimators[0]
    for run_id in data.scored_runs:
        series, run = data.series.get((run_id, best)), data.run(run_id)
        if series is not None and series.answers.valid.any():
            panel = Panel(f"{run_id}: {best}", "x, m", "y, m", _height(run.world.bounds), fits=False)
            _floor(panel, run)
            _track(panel, series)
            _lead(panel, data, series)
            panel.axes.set_aspect("equal")
            yield panel


def _height(floor: Bounds) -> float:
    """In inches, so that the floor is as wide as the panel, unless it is long and narrow."""
    shape = (floor.y_max - floor.y_min) / (floor.x_max - floor.x_min)
    return 1.7 + float(np.clip(3.4 * shape, 1.2, 4.2))


def _floor(panel: Panel, run: Run) -> None:
    _bound(panel, run)
    for wall in run.world.walls:
        panel.axes.plot(*np.array(wall).T, color="0.7", linewidth=1)
    panel.axes.plot([a.x for a in run.world.anchors], [a.y for a in run.world.anchors], "k^", markersize=6)


def _bound(panel: Panel, run: Run) -> None:
    """Error of the best unbiased fix from one reading of each anchor, as contours [m]."""
    readings, grid = Readings(radio_of(run)), Grid.over(run.world.bounds, default_step(run.world.bounds))
    if len(run.world.anchors) < 2:
        return
    error_m = error_map(run.world.anchors, readings, grid.places(run.world.robot.antenna_m[2]))
    if np.isfinite(error_m).sum() > 1:
        levels = np.unique(np.round(np.nanquantile(error_m, (0.1, 0.3, 0.5, 0.7, 0.9)), 2))
        lines = panel.axes.contour(grid.x, grid.y, error_m, levels=levels, colors="0.8", linewidths=0.8, zorder=0)
        panel.axes.clabel(lines, fmt="%.2g m", fontsize=6)


def _track(panel: Panel, series: Series) -> None:
    """The true path in grey, the answers over it."""
    panel.axes.plot(series.instants.x, series.instants.y, color="0.5", linewidth=1)
    valid = np.flatnonzero(series.answers.valid)
    few = valid[peaks(series.error_m[valid], MOST_POINTS)]
    where = series.answers.x[few], series.answers.y[few]
    drawn = panel.axes.scatter(*where, c=100.0 * series.error_m[few], cmap="viridis", s=5)
    panel.figure.colorbar(drawn, ax=panel.axes, label="position error, cm", location="bottom", shrink=0.8, aspect=40)


def _lead(panel: Panel, data: ReportData, series: Series) -> None:
    valid, cell = np.flatnonzero(series.answers.valid), series.result.cell
    few = valid[peaks(series.error_m[valid], LEADING)]
    caption = f"{cell.estimator.id}, {cell.run.id}"
    where = series.answers.x[few], series.answers.y[few]
    panel.lead(*where, data.anchor(series.result), caption, series.time_s[few])
