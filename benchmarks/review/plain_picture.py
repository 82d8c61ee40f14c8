"""Tracks and errors of a review as one picture by matplotlib, for machines on which Rerun cannot draw."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.metrics.catalogue import unit_of
from benchmarks.review.canvas import mostly_jumps
from benchmarks.review.cdf import LEAST_M
from benchmarks.review.drawing import Drawing, drawings
from benchmarks.review.folding import Reviewed
from benchmarks.review.frame import MARGIN, Frame
from benchmarks.runner.scoring import Score
from fusion.output.colours import ANCHOR, GROUND, TRUTH, WALL
from fusion.output.figures import PANEL_INCHES, as_png, plain, require_matplotlib
from fusion.output.files import write
from fusion.values import NANOSECONDS
from logs.run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ACROSS = 3
"""So many floors side by side."""
ERRORS_INCHES = 2.6
"""Height of the errors over time."""
INK = "0.75"


def draw_plainly(run: Run, reviewed: Sequence[Reviewed], output: Path) -> Path:
    """Write the PNG file ``output``: the floor with the true path once for each of the best estimators, and under them
    their position errors over time. Raises `FusionError` where matplotlib is missing or the place cannot be written to.
    """
    require_matplotlib()
    write(output, as_png(figure(run, drawings(run, reviewed))))
    return output


def figure(run: Run, drawn: Sequence[Drawing]) -> Figure:
    """Those of ``drawn`` that are shown, the best first; no global state of pyplot, so nothing has to be closed."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    frame, shown = Frame.around(run), [drawing for drawing in drawn if drawing.shown]
    down = -(-len(shown) // ACROSS)
    heights = [_height(frame)] * down + [ERRORS_INCHES]
    size, layout = (ACROSS * PANEL_INCHES, sum(heights)), ConstrainedLayoutEngine(h_pad=0.08)
    made = Figure(figsize=size, layout=layout, facecolor=plain(GROUND))
    grid = made.add_gridspec(down + 1, ACROSS, height_ratios=heights)
    for place, drawing in enumerate(shown):
        _map(made.add_subplot(grid[divmod(place, ACROSS)]), run, frame, drawing)
    _errors(made.add_subplot(grid[down, :]), frame, shown)
    which = "all estimators" if len(shown) == len(drawn) else f"the {len(shown)} best of {len(drawn)} estimators"
    made.suptitle(f"{run.name}: tracks (m, y up) of {which}, the true path in white", color=INK)
    return made


def _height(frame: Frame) -> float:
    """Inches for a floor that is as wide as its panel, unless it is long and narrow."""
    shape = (frame.y_max - frame.y_min) / max(frame.x_max - frame.x_min, LEAST_M)
    return 0.6 + PANEL_INCHES * float(np.clip(shape, 0.3, 1.2))


def _map(axes: Axes, run: Run, frame: Frame, drawing: Drawing) -> None:
    """The floor with the true path and the track of one estimator."""
    _dark(axes)
    _floor(axes, run, frame)
    time_ns, xy, _ = drawing.track
    style = "." if len(xy) > 1 and mostly_jumps(time_ns, xy) else "-"
    axes.plot(*xy.T, style, color=plain(drawing.colour), markersize=2, linewidth=1.2)
    axes.set_title(drawing.name + _score(drawing.score), color=plain(drawing.colour), fontsize=10)
    room = MARGIN * max(frame.x_max - frame.x_min, LEAST_M)
    axes.set(xlim=(frame.x_min - room, frame.x_max + room), ylim=(frame.y_min - room, frame.y_max + room))
    axes.set_aspect("equal")


def _score(score: Score) -> str:
    """For a title: how it ended or, where that is well, the number that it is ranked by."""
    if score.status == "unscored":
        return ""
    if score.status != "ok":
        return f": {score.status}"
    return f": 75 % of errors below {unit_of('pos_p75').number(score.metrics['pos_p75'])} cm"


def _floor(axes: Axes, run: Run, frame: Frame) -> None:
    from matplotlib.patches import Rectangle

    bounds, middle = run.world.bounds, 0.5 * (frame.x_min + frame.x_max)
    corner, width, height = (bounds.x_min, bounds.y_min), bounds.x_max - bounds.x_min, bounds.y_max - bounds.y_min
    axes.add_patch(Rectangle(corner, width, height, fill=False, color=plain(WALL), linewidth=1.0))
    for wall in run.world.walls:
        axes.plot(*np.array(wall).T, color=plain(WALL), linewidth=1.5)
    if run.truth is not None:
        axes.plot(run.truth.x, run.truth.y, color=plain(TRUTH), linewidth=0.8)
    for anchor in run.world.anchors:
        axes.plot(anchor.x, anchor.y, "^", color=plain(ANCHOR), markersize=6)
        aside, side = ((-5.0, 3.0), "right") if anchor.x > middle else ((5.0, 3.0), "left")
        text = axes.annotate(anchor.id, (anchor.x, anchor.y), aside, textcoords="offset points")
        text.set(color=plain(ANCHOR), horizontalalignment=side)


def _errors(axes: Axes, frame: Frame, shown: Sequence[Drawing]) -> None:
    """Position errors over time, with gaps where there was no valid answer."""
    _dark(axes)
    axes.grid(visible=True, color="0.2")
    for drawing in shown:
        if drawing.instants is not None and drawing.errors is not None:
            time_s = (drawing.instants.time_ns - frame.start_ns) / NANOSECONDS
            error_m = np.hypot(*drawing.errors.error[:, :2].T)
            axes.plot(time_s, error_m, color=plain(drawing.colour), linewidth=1.2, label=drawing.name)
    axes.set(xlabel="time since the start, s", ylabel="position error, m", xlim=(0.0, frame.duration_s or 1.0))
    axes.set_ylim(bottom=0.0)
    if axes.lines:
        axes.legend(loc="upper left", ncols=ACROSS, frameon=False, fontsize=8, labelcolor="linecolor")


def _dark(axes: Axes) -> None:
    """On the ground that the colours are made for."""
    axes.set_facecolor(plain(GROUND))
    axes.tick_params(colors=INK, labelsize=8)
    axes.xaxis.label.set_color(INK)
    axes.yaxis.label.set_color(INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color("0.4")
