"""The distribution of position errors as a picture: Rerun has no plots of one value over another, so it is drawn.

A curve shows which share of all instants had an error of at most so much. Instants without a valid answer never have:
the curve saturates at the availability.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.score import quantile
from benchmarks.review.canvas import STRONG, Canvas
from benchmarks.review.drawing import Drawing
from fusion.arrays import Floats
from fusion.output.colours import TRUTH, WALL

WIDTH = 1.6
"""The picture is this wide and 1 high, for a 2D view keeps proportions."""
POINTS = 400
"""Corners of one curve."""
NICE = (1.0, 2.0, 2.5, 5.0, 10.0)
TICKS = 5
HEADROOM = 1.05
LEAST_M = 0.001
"""Nobody looks closer than that."""
SHARES = (0.25, 0.5, 0.75, 0.95)


class CdfAxes(NamedTuple):
    """The picture shows errors from 0 to ``error_max_m``, with a tick every ``step_m``."""

    error_max_m: float
    step_m: float

    @classmethod
    def around(cls, errors_m: Sequence[Floats]) -> CdfAxes:
        """Axes that hold 95 % of the finite errors (n,) [m] of each estimator, in about `TICKS` round steps."""
        reach = [quantile(finite, 0.95) for own in errors_m if len(finite := own[np.isfinite(own)])]
        largest = max(HEADROOM * max(reach, default=1.0), LEAST_M)
        step = round_step(largest / TICKS)
        return cls(step * math.ceil(largest / step - 1e-9), step)

    def curve(self, errors_m: Floats) -> Floats:
        """Corners (k, 2) of the curve of errors (n,) in the picture, x in [0, `WIDTH`] and y in [0, 1]."""
        finite = np.sort(errors_m[np.isfinite(errors_m)])
        shown = finite[finite <= self.error_max_m]
        corners = np.unique(np.linspace(0, len(shown) - 1, min(len(shown), POINTS)).round().astype(np.int64))
        x = np.concatenate([[0.0], shown[corners], [self.error_max_m]]) * WIDTH / self.error_max_m
        y = np.concatenate([[0], corners + 1, [len(shown)]]) / max(len(errors_m), 1)
        return np.column_stack([x, y])


def round_step(least: float) -> float:
    """The least round number that is not below ``least``, which is positive."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(nice * power for nice in NICE if nice * power >= least * (1.0 - 1e-9))


def draw_axes(canvas: Canvas, axes: CdfAxes) -> None:
    """The grid with its ticks; y up."""
    rr = canvas.rr
    canvas.style(["cdf"], rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0])))
    count = round(axes.error_max_m / axes.step_m)
    across = [axes.step_m * i for i in range(count + 1)]
    columns = [error * WIDTH / axes.error_max_m for error in across]
    grid = [[(x, 0.0), (x, 1.0)] for x in columns] + [[(0.0, y), (WIDTH, y)] for y in (0.0, *SHARES, 1.0)]
    canvas.style(["cdf", "grid"], rr.LineStrips2D(grid, colors=[(*WALL, 120)], radii=[-0.5], draw_order=-20))
    places = [(x, -0.03) for x in columns] + [(-0.12, y + 0.03) for y in SHARES]
    # The unit stands in the title: in a small window the ticks would run into one another.
    texts = [f"{error:g}" for error in across] + [f"{100 * y:.0f} %" for y in SHARES]
    look = {"colors": [(*TRUTH, STRONG)], "radii": [-0.1], "labels": texts, "show_labels": True}
    canvas.style(["cdf", "ticks"], rr.Points2D(places, **look))


def draw_curve(canvas: Canvas, drawing: Drawing, axes: CdfAxes, thickness: float) -> None:
    """One estimator's curve."""
    if drawing.score.errors is not None and np.isfinite(drawing.score.errors.position).any():
        corners, colour = axes.curve(drawing.score.errors.position), (*drawing.colour, STRONG)
        strip = canvas.rr.LineStrips2D([corners], colors=[colour], radii=[-thickness])
        canvas.style(["cdf", "estimate", drawing.name], strip)
