"""The paper's straight line through the moves, and the residual lengths and turns of the fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fusion.arrays import Floats
from fusion.output.colours import BLUE, VERMILLION
from fusion.output.figures import label, panels, plain
from sensors.calibration.arcs import WheelScales
from sensors.calibration.odometry import residuals
from sensors.calibration.wheel_residuals import LinearFit, MeasuredSegment

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(trend: LinearFit | None, pieces: Sequence[MeasuredSegment], before: WheelScales, after: WheelScales) -> Figure:
    """Three panels: actual over measured length, residual lengths and residual turns, before and after."""
    figure, (line, lengths, turns) = panels(3, 3.6)
    label(line, "Straight moves and the paper's line", "measured, m", "actual minus measured, cm")
    if trend is not None:
        _draw_trend(line, trend)
    was, now = residuals(before, pieces), residuals(after, pieces)
    path = np.array([abs(0.5 * float(each.left.sum() + each.right.sum())) for each in pieces])
    turned = np.degrees([each.segment.turn_rad for each in pieces])
    _draw_residuals(lengths, path, 100.0 * was[0], 100.0 * now[0])
    label(lengths, "Length: true minus measured", "measured, m", "residual, cm")
    _draw_residuals(turns, turned, np.degrees(was[1]), np.degrees(now[1]))
    label(turns, "Turn: true minus measured", "true turn, °", "residual, °")
    for axes in (lengths, turns):
        axes.legend(fontsize=8)
    return figure


def _draw_trend(axes: Axes, trend: LinearFit) -> None:
    """The differences: over metres, a share of a percent cannot be seen on a line through them all."""
    reach = np.array([0.0, 1.05 * float(trend.measured_m.max())])
    axes.plot(trend.measured_m, 100.0 * (trend.true_m - trend.measured_m), "o", color=plain(BLUE), markersize=4)
    line = trend.line.scale * reach + trend.line.offset_m - reach
    axes.plot(reach, 100.0 * line, color=plain(VERMILLION))
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    title = f"actual = ({trend.scale.text(4)}) measured {100.0 * trend.offset_m.value:+.2f} cm"
    axes.set_title(f"Straight moves: {title}", fontsize=9)


def _draw_residuals(axes: Axes, x: Floats, was: Floats, now: Floats) -> None:
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.plot(x, was, "o", color=plain(VERMILLION), markersize=4, markerfacecolor="none", label="world as it was")
    axes.plot(x, now, "o", color=plain(BLUE), markersize=4, label="fit (in-sample)")
