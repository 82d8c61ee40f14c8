"""The figures of a report, by matplotlib, in the colours that estimators have everywhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from benchmarks.metrics.score import quantile
from benchmarks.plotting import label, panels, plain_colour, plain_ticks
from benchmarks.report.material import Material, radio_of
from benchmarks.runner.results import by_contestant, score_matrix
from benchmarks.sites.placement import Grid, Readings, default_step, error_map
from logs.run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINES = ("-", "--", ":", "-.")
BAND = ("anees", "anees_band_low", "anees_band_high")
PER_ROW = 3
LONGEST_LINE = 2000
"""Points a line is thinned to: a picture shows no more."""


def summary(material: Material) -> Figure:
    """Distribution, run by run, and honesty, side by side."""
    figure, (left, middle, right) = panels(3, 4.2)
    _cdf(left, material)
    _paired(middle, material)
    _consistency(right, material)
    return figure


def _cdf(axes: Axes, material: Material) -> None:
    """How often the error is below a distance; a curve ends at the availability, not at one."""
    for name in material.contestants:
        errors = np.concatenate([s.error_m for (_, own), s in material.series.items() if own == name] or [np.zeros(0)])
        finite = np.sort(errors[np.isfinite(errors)])
        if len(finite):
            share = np.arange(1, len(finite) + 1) / len(errors)
            step = max(len(finite) // LONGEST_LINE, 1)
            axes.plot(100.0 * finite[::step], 100.0 * share[::step], **_style(material, name))
    _log(axes, "x", (1.0,))
    axes.set_ylim(0.0, 100.0)
    label(axes, "all shown runs, without faults", "position error, cm", "share of instants, %")
    axes.legend(frameon=False, fontsize=8)


def over_time(material: Material) -> Figure:
    """Position error over time, run by run; gaps where there was no valid answer."""
    figure, row = panels(max(len(material.scored_runs), 1), 3.2, columns=PER_ROW)
    for axes, run_id in zip(row, material.scored_runs, strict=False):
        for name in material.contestants:
            if (series := material.series.get((run_id, name))) is not None:
                step = max(len(series.time_s) // LONGEST_LINE, 1)
                error_cm = 100.0 * np.where(np.isfinite(series.error_m), series.error_m, np.nan)
                axes.plot(series.time_s[::step], error_cm[::step], linewidth=1, **_style(material, name))
        axes.set_ylim(0.0, None)
        label(axes, run_id, "time, s", "position error, cm")
    _shared_legend(figure, row[0])
    return figure


def _paired(axes: Axes, material: Material) -> None:
    """The ranking metric of every run, joined run by run: what the verdicts are made of."""
    grouped = by_contestant(material.results)
    columns = [np.median(score_matrix(grouped[name], material.metric), axis=1) for name in material.contestants]
    scores = material.unit.factor * np.stack(columns, axis=1)
    for row in scores:
        axes.plot(range(len(row)), row, color="0.7", linewidth=1, zorder=1)
    for place, name in enumerate(material.contestants):
        known = np.isfinite(scores[:, place])
        colour = plain_colour(_use(material, name))
        axes.scatter(np.full(known.sum(), place), scores[known, place], color=colour, s=24, zorder=2)
    _log(axes, "y")
    axes.set_xticks(range(len(columns)), material.contestants, rotation=30, ha="right")
    label(axes, "one line per run", "", material.axis)


def _consistency(axes: Axes, material: Material) -> None:
    """ANEES of every cell without faults; the grey line beside it is where an honest filter's lies with 95 %: its
    chi-square band at the effective number of samples.
    """
    grouped = by_contestant(material.results)
    axes.axhline(1.0, color="0.5", linewidth=1, zorder=1)
    for place, name in enumerate(material.contestants):
        found = [tuple(result.metrics.get(key, np.nan) for key in BAND) for result in grouped[name]]
        values, low, high = np.array(found).T
        across = place + np.linspace(-0.2, 0.2, len(values) + 2)[1:-1]
        axes.vlines(across, low, high, color="0.8", linewidth=3, zorder=1)
        axes.scatter(across, values, color=plain_colour(_use(material, name)), s=18, zorder=2)
    _log(axes, "y")
    axes.set_xticks(range(len(material.contestants)), material.contestants, rotation=30, ha="right")
    label(axes, "above 1: more certain than right", "", "ANEES")


def maps(material: Material) -> Figure:
    """Where the best estimator errs: truth in grey, its track coloured by its error."""
    figure, row = panels(max(len(material.scored_runs), 1), 4.0, columns=PER_ROW)
    best = material.contestants[0]
    for axes, run_id in zip(row, material.scored_runs, strict=False):
        if (series := material.series.get((run_id, best))) is None:
            continue
        run = material.run(run_id)
        world = run.world
        _bound(axes, run)
        for wall in world.walls:
            axes.plot(*np.array(wall).T, color="0.7", linewidth=1)
        axes.plot(series.instants.x, series.instants.y, color="0.5", linewidth=1)
        valid = series.answers.valid
        step = max(int(valid.sum()) // LONGEST_LINE, 1)
        where = (series.answers.x[valid][::step], series.answers.y[valid][::step])
        drawn = axes.scatter(*where, c=100.0 * series.error_m[valid][::step], cmap="viridis", s=5)
        axes.plot([a.x for a in world.anchors], [a.y for a in world.anchors], "k^", markersize=6)
        axes.set_aspect("equal")
        label(axes, f"{run_id}: {best}", "x, m", "y, m")
        figure.colorbar(drawn, ax=axes, label="position error, cm", shrink=0.8)
    return figure


def _bound(axes: Axes, run: Run) -> None:
    """What the best unbiased fix from one reading of each anchor errs, as contours [m]."""
    readings, grid = Readings(radio_of(run)), Grid.over(run.world.bounds, default_step(run.world.bounds))
    if len(run.world.anchors) < 2:
        return
    error_m = error_map(run.world.anchors, readings, grid.places(run.world.robot.antenna_m[2]))
    if np.isfinite(error_m).sum() > 1:
        levels = np.unique(np.round(np.nanquantile(error_m, (0.1, 0.3, 0.5, 0.7, 0.9)), 2))
        lines = axes.contour(grid.x, grid.y, error_m, levels=levels, colors="0.8", linewidths=0.8, zorder=0)
        axes.clabel(lines, fmt="%.2g m", fontsize=6)


def cost(material: Material) -> Figure:
    """Accuracy against processor time, where `fusion bench time` has measured it: lower left is better."""
    figure, (axes,) = panels(1, 3.6)
    grouped = by_contestant(material.results)
    for name, least_us in material.timing.items():
        if name in grouped:
            score = quantile(np.median(score_matrix(grouped[name], material.metric), axis=1), 0.5)
            if np.isfinite(score):
                score *= material.unit.factor
                axes.scatter(least_us, score, color=plain_colour(_use(material, name)), s=30)
                axes.annotate(name, (least_us, score), textcoords="offset points", xytext=(5, 3), fontsize=8)
    _log(axes, "x")
    _log(axes, "y")
    label(axes, "accuracy against cost", "processor time per measurement, µs", material.axis)
    return figure


def _log(axes: Axes, which: Literal["x", "y"], subs: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """A logarithmic axis, where anything is on it: where every estimator was lost, nothing is."""
    axis, least = {"x": (axes.xaxis, axes.dataLim.minposx), "y": (axes.yaxis, axes.dataLim.minposy)}[which]
    if np.isfinite(least):
        axes.set(**{f"{which}scale": "log"})
        plain_ticks(axis, subs)


def _style(material: Material, name: str) -> dict[str, Any]:
    """The colour of the estimator; its contestants are told apart by their lines."""
    use = _use(material, name)
    alike = [other for other in material.contestants if _use(material, other) == use]
    return {"color": plain_colour(use), "linestyle": LINES[alike.index(name) % len(LINES)], "label": name}


def _use(material: Material, name: str) -> str:
    return next(one.use for one in material.suite.contestants if one.id == name)


def _shared_legend(figure: Figure, axes: Axes) -> None:
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=5, frameon=False, fontsize=8)


FIGURES: Mapping[str, Callable[[Material], Figure]] = {
    "summary": summary,
    "over_time": over_time,
    "maps": maps,
    "cost": cost,
}
