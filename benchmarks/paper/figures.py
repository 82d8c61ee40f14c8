"""The figures of the reproduction, drawn by matplotlib; the paper's own three result figures first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metrics.score import CHI_SQUARE_95, quantile
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretations import INTERPRETATIONS, ORIGINS_M, SCALES
from benchmarks.paper.outlier_rule_examples import REPAIRED, lock_out_example
from benchmarks.paper.published import ODOMETRY, PROPOSED, WIFI
from benchmarks.paper.straight_moves import MOVES_M
from benchmarks.paper.summary import Spread
from benchmarks.paper.tables import CURVES, by_median
from fusion.arrays import Floats
from fusion.output.figures import label, panels, plain_colour, plain_ticks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKERS = {ODOMETRY: "s", WIFI: "^", PROPOSED: "o"}


def errors(outcomes: Sequence[Outcome]) -> Figure:
    """Error against trial number (the paper's Figs. 4, 7 and 8): one run, and where 90 % of all runs lie."""
    figure, row = panels(len(outcomes), 4.0)
    for axes, outcome in zip(row, outcomes, strict=True):
        typical, trial = typical_run(outcome), np.arange(1, outcome.refused.shape[1] + 1)
        for estimator, title in CURVES.items():
            values, colour = 100.0 * outcome.coordinate(estimator), _colour(estimator)
            low, high = ([quantile(column, share) for column in values.T] for share in (0.05, 0.95))
            axes.fill_between(trial, low, high, color=colour, alpha=0.15, linewidth=0)
            named = None if axes is not row[0] else title
            axes.plot(trial, values[typical], color=colour, marker=MARKERS[estimator], markersize=4, label=named)
            axes.axhline(100.0 * outcome.environment.maxima_m[estimator], color=colour, linestyle=":", linewidth=1)
        title = f"{outcome.environment.title}, seed {outcome.seeds[typical]}"
        label(axes, title, "trial", "absolute error, larger coordinate, cm")
        axes.set_ylim(0.0, None)
        axes.set_xticks(range(2, len(trial) + 1, 2))
    figure.legend(loc="outside lower center", ncols=len(CURVES), frameon=False)
    return figure


def typical_run(outcome: Outcome) -> int:
    """The run whose odometry and Wi-Fi maxima are nearest to the published ones; the proposed method does not count."""
    away = [
        np.abs(np.log(outcome.largest(estimator) / outcome.environment.maxima_m[estimator]))
        for estimator in (ODOMETRY, WIFI)
    ]
    return int(np.argmin(away[0] + away[1]))


def estimators(outcomes: Sequence[Outcome]) -> Figure:
    """Largest error of every estimator: median and 90 % interval, the published maximum beside it."""
    estimators = by_median(outcomes)[::-1]
    figure, row = panels(len(outcomes), 4.6, sharey=True)
    for axes, outcome in zip(row, outcomes, strict=True):
        for place, estimator in enumerate(estimators):
            median, low, high = (100.0 * value for value in Spread.of(outcome.largest(estimator)))
            axes.plot([low, high], [place, place], color=_colour(estimator), linewidth=2)
            axes.plot(median, place, marker="o", color=_colour(estimator))
        axes.axvline(100.0 * outcome.environment.proposed_max_m, color="black", linestyle=":", linewidth=1)
        axes.set_xscale("log")
        plain_ticks(axes.xaxis)
        label(axes, outcome.environment.title, "largest coordinate error, cm (dotted: published)", "")
    row[0].set_yticks(range(len(estimators)), estimators)
    return figure


def interpretations(outcomes: Sequence[Outcome]) -> Figure:
    """Median largest error of all interpretations, by the quantity that the percentage is of."""
    figure, row = panels(len(outcomes), 3.6)
    for axes, outcome in zip(row, outcomes, strict=True):
        medians = np.array([100.0 * Spread.of(column).median for column in outcome.interpretations.T])
        for place, scale in enumerate(SCALES):
            for feedback, filled, shift in ((True, _colour(PROPOSED), -0.12), (False, "none", 0.12)):
                own = [k for k, each in enumerate(INTERPRETATIONS) if each.values[:2] == (scale, feedback)]
                where = np.full(len(own), place + shift)
                named = None if place or axes is not row[0] else ("feedback" if feedback else "no feedback")
                axes.scatter(where, medians[own], s=22, facecolor=filled, edgecolor=_colour(PROPOSED), label=named)
        for estimator in CURVES:
            published = 100.0 * outcome.environment.maxima_m[estimator]
            axes.axhline(published, color=_colour(estimator), linestyle=":", linewidth=1)
        axes.set_yscale("log")
        plain_ticks(axes.yaxis)
        axes.set_xticks(range(len(SCALES)), SCALES)
        label(axes, outcome.environment.title, "outlier in percent of", "median largest error, cm")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def weaknesses(outcomes: Sequence[Outcome]) -> Figure:
    """Lock-out in its minimal example, and the same runs with the origin moved."""
    figure, row = panels(1 + len(outcomes), 3.4)
    legs = lock_out_example()
    trial = [leg.trial for leg in legs]
    row[0].plot(trial, [100.0 * leg.proposed_m for leg in legs], color=_colour(PROPOSED), marker="o", label="published")
    row[0].plot(trial, [100.0 * leg.repaired_m for leg in legs], color=_colour(REPAIRED), marker="D", label="repaired")
    row[0].legend(frameon=False)
    label(row[0], "lock-out: one slip of 1 m, exact fixes", "trial", "error, cm")
    moved = [(offset_m, k) for k, offset_m in enumerate(ORIGINS_M) if offset_m is not None]
    for axes, outcome in zip(row[1:], outcomes, strict=True):
        spreads = 100.0 * np.array([Spread.of(outcome.origins[:, k]) for _, k in moved])
        axes.fill_between(range(len(moved)), spreads[:, 1], spreads[:, 2], color=_colour(PROPOSED), alpha=0.15)
        axes.plot(range(len(moved)), spreads[:, 0], color=_colour(PROPOSED), marker="o")
        axes.set_xticks(range(len(moved)), [f"{offset_m:g}" for offset_m, _ in moved])
        axes.set_ylim(0.0, None)
        label(axes, outcome.environment.title, "origin moved by, m", "largest error, cm")
    return figure


def floors(outcomes: Sequence[Outcome]) -> Figure:
    """Floor, access points and route, with the 95 % ellipse of the best unbiased radio fix at each trial point."""
    from matplotlib.patches import Ellipse

    figure, row = panels(len(outcomes), 4.0)
    for axes, outcome in zip(row, outcomes, strict=True):
        for wall in outcome.scenario.world.walls:
            axes.plot(*np.array(wall).T, color="0.6", linewidth=1)
        places = np.array(outcome.scenario.route.waypoints_m)
        axes.plot(*places.T, color="0.3", linewidth=1, marker=".", markersize=5)
        for trial, ((x, y), covariance) in enumerate(zip(places[1:], outcome.bound, strict=True), start=1):
            axes.add_patch(Ellipse((x, y), **_ellipse(covariance), color=_colour(WIFI), alpha=0.3, linewidth=0))
            axes.annotate(f"{trial}", (x, y), textcoords="offset points", xytext=(3, 3), fontsize=7)
        anchors = np.array([(anchor.x, anchor.y) for anchor in outcome.scenario.world.anchors])
        axes.plot(*anchors.T, linestyle="none", marker="^", color="black", markersize=7)
        axes.set_aspect("equal")
        label(axes, outcome.environment.title, "x, m", "y, m")
    return figure


def _ellipse(covariance: Floats) -> dict[str, float]:
    """Width and height [m] of the 95 % ellipse, and its angle [degrees]."""
    values, vectors = np.linalg.eigh(covariance)
    height, width = 2.0 * np.sqrt(CHI_SQUARE_95[2] * values)
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    return {"width": float(width), "height": float(height), "angle": float(angle)}


def moves(outcomes: Sequence[Outcome]) -> Figure:
    """Actual over measured distance (the paper's Fig. 3), with its trend line."""
    figure, row = panels(len(outcomes), 3.2)
    for axes, outcome in zip(row, outcomes, strict=True):
        measured = outcome.moves[typical_run(outcome)]
        slope, offset = np.polyfit(measured, MOVES_M, 1)
        axes.plot(measured, MOVES_M, linestyle="none", marker="s", markersize=4, color=_colour(ODOMETRY))
        axes.plot(measured, slope * measured + offset, color=_colour(ODOMETRY), linewidth=1)
        label(axes, f"{outcome.environment.short}: y = {slope:.4f} x {offset:+.4f}", "set, m", "actual, m")
    return figure


FIGURES: Mapping[str, Callable[[Sequence[Outcome]], Figure]] = {
    "errors": errors,
    "estimators": estimators,
    "interpretations": interpretations,
    "weaknesses": weaknesses,
    "floors": floors,
    "moves": moves,
}


def _colour(estimator: str) -> tuple[float, float, float]:
    """The estimator's colour everywhere; on a gyro it keeps it."""
    return plain_colour(estimator.partition(" ")[0])
