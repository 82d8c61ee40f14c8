"""The map of a plan: error by colour and contour, walls, anchors, and where one more or a moved one should stand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.limits.anchor_placement import Proposal
from benchmarks.limits.floor_plan import Plan, title
from fusion.arrays import Floats
from fusion.output.figures import as_png, require_matplotlib
from fusion.output.files import write

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect

WIDTH_IN = 9.0
COLOURS = "viridis"
UNDEFINED = "0.75"
INK, HALO, GREY = "black", "white", "0.35"
TOP = 0.98
"""The colours end at this quantile of the errors."""
LEVELS = (0.1, 0.3, 0.5, 0.75, 0.9)
"""Contours stand at these quantiles of the errors, in two digits."""
PROPOSED = "#d55e00"
"""Vermillion of Okabe & Ito (2008): apart from every colour of the map."""


def draw(plan: Plan, output: Path) -> None:
    """Write the map as a PNG, the same bytes for the same plan and version of matplotlib; raises `FusionError`."""
    require_matplotlib()
    write(output, as_png(picture(plan)))


def picture(plan: Plan) -> Figure:
    """The map as a figure; no global state of pyplot, so nothing has to be closed."""
    from matplotlib.figure import Figure

    bounds = plan.world.bounds
    shape = (bounds.y_max - bounds.y_min) / (bounds.x_max - bounds.x_min)
    figure = Figure(figsize=(WIDTH_IN, min(max(0.78 * WIDTH_IN * shape + 1.6, 3.5), 14.0)), layout="constrained")
    axes = figure.add_subplot()
    _errors(figure, axes, plan)
    _walls(axes, plan)
    _anchors(axes, plan)
    for proposal in plan.proposals:
        _proposal(axes, plan, proposal)
    axes.set(xlim=(bounds.x_min, bounds.x_max), ylim=(bounds.y_min, bounds.y_max), aspect="equal")
    axes.set(xlabel="x, m", ylabel="y, m")
    axes.set_title(f"{title(plan)}\n{_summary(plan)}", fontsize=11)
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def _summary(plan: Plan) -> str:
    median_m, p95_m, *_ = plan.spread
    count = "one reading" if plan.readings.scans == 1 else f"{plan.readings.scans} readings"
    return f"{count} of each anchor: median {median_m:.2f} m, 95 % of the floor below {p95_m:.2f} m"


def _errors(figure: Figure, axes: Axes, plan: Plan) -> None:
    """Colours that end at a quantile, so that a few bad corners do not hide the rest; undefined cells are grey."""
    import matplotlib

    bounds = plan.world.bounds
    known = plan.error_m[np.isfinite(plan.error_m)]
    low, high = (float(known.min()), float(np.quantile(known, TOP))) if len(known) else (0.0, 1.0)
    colours = matplotlib.colormaps[COLOURS].with_extremes(bad=UNDEFINED)
    extent = (bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max)
    image = axes.imshow(plan.error_m, origin="lower", extent=extent, cmap=colours, vmin=low, vmax=high)
    figure.colorbar(image, ax=axes, label="root mean square error, m", extend="max", shrink=0.9)
    levels = contour_levels(known)
    if levels and min(plan.error_m.shape) >= 2:
        lines = axes.contour(plan.grid.x, plan.grid.y, plan.error_m, levels=levels, colors=HALO, linewidths=1.2)
        lines.set_path_effects(_halo(2.2, GREY))
        places = _label_places(plan, lines.allsegs)
        for text in axes.clabel(lines, fmt="%g m", fontsize=9, colors=INK, manual=places, zorder=4):
            text.set_path_effects(_halo(3.0))


def contour_levels(known: Floats) -> list[float]:
    """Quantiles of the errors (n,) [m] in two digits: lines that divide the floor, and do not crowd where it is steep.

    >>> contour_levels(np.linspace(1.0, 2.0, 101))
    [1.1, 1.3, 1.5, 1.8, 1.9]
    """
    if len(known) == 0:
        return []
    low, high = float(known.min()), float(known.max())
    rounded = {float(f"{value:.2g}") for value in np.quantile(known, LEVELS)}
    return sorted(level for level in rounded if low < level < high)


def _label_places(plan: Plan, lines: Sequence[Sequence[Floats]]) -> list[tuple[float, float]]:
    """One place on the longest line of each level, as far from anchors, edges and earlier labels as it goes."""
    bounds = plan.world.bounds
    crowd = [(anchor.x, anchor.y) for anchor in plan.world.anchors]
    labels: list[tuple[float, float]] = []
    for line in (max(level, key=len) for level in lines if any(map(len, level))):
        x, y = line.T
        room = np.min([x - bounds.x_min, bounds.x_max - x, y - bounds.y_min, bounds.y_max - y], axis=0)
        near = np.min([np.hypot(x - left, y - up) for left, up in [*crowd, *labels]], axis=0)
        best = int(np.argmax(np.minimum(room, near)))
        labels.append((float(x[best]), float(y[best])))
    return labels


def _walls(axes: Axes, plan: Plan) -> None:
    for wall in plan.world.walls:
        (line,) = axes.plot(*zip(*wall, strict=True), color=INK, linewidth=2.0, solid_capstyle="butt", zorder=3)
        line.set_path_effects(_halo(3.6))


def _anchors(axes: Axes, plan: Plan) -> None:
    """Triangles, each named on the side where the floor is."""
    bounds, scale = plan.world.bounds, _scale(len(plan.world.anchors))
    for place, anchor in enumerate(plan.world.anchors):
        label = None if place else "anchor"
        axes.plot(
            anchor.x, anchor.y, "^", color=INK, mec=HALO, ms=12 * scale, ls="", clip_on=False, zorder=5, label=label
        )
        right = anchor.x > 0.5 * (bounds.x_min + bounds.x_max)
        upper = anchor.y > 0.5 * (bounds.y_min + bounds.y_max)
        aside = ((-9.0 if right else 9.0) * scale, (-4.0 if upper else 4.0) * scale)
        text = axes.annotate(anchor.id, (anchor.x, anchor.y), aside, textcoords="offset points", zorder=6)
        text.set(
            ha="right" if right else "left",
            va="top" if upper else "bottom",
            path_effects=_halo(3.0 * scale),
            weight="bold",
        )
        text.set_fontsize(10.0 * scale)


def _scale(count: int) -> float:
    """Sizes of markers and names for so many anchors: the usual ones up to a dozen, then smaller, but legible."""
    return float(np.clip(np.sqrt(12.0 / count), 0.55, 1.0))


def _proposal(axes: Axes, plan: Plan, proposal: Proposal) -> None:
    """A star or, for a move, a diamond with an arrow from where the anchor stands now."""
    place, before = proposal.anchor, plan.world.anchor(proposal.anchor.id)
    if before is not None:
        style = {"arrowstyle": "-|>", "color": PROPOSED, "linewidth": 2.0, "shrinkA": 8, "shrinkB": 5}
        axes.annotate("", (place.x, place.y), (before.x, before.y), arrowprops=style, zorder=4)
    shape, size = ("*", 20) if before is None else ("D", 10)
    what = "best place for one more" if before is None else f"best move: {place.id}"
    label = f"{what}, ({place.x:.2f}, {place.y:.2f}): p95 {proposal.spread.p95_m:.2f} m"
    axes.plot(place.x, place.y, shape, color=PROPOSED, mec=HALO, ms=size, ls="", clip_on=False, zorder=7, label=label)


def _halo(width: float, colour: str = HALO) -> list[AbstractPathEffect]:
    """Letters and lines that stand out on any ground."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground=colour)]
