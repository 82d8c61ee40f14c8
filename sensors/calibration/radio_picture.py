"""Readings and their line over distance, and the residuals of all places."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fusion import World
from fusion.output.colours import anchor_colour
from fusion.output.figures import label, panels, plain, plain_ticks
from sensors.calibration.radio import RadioCalibration, calibrated
from sensors.calibration.readings_by_place import UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VALUES = {"rssi": "RSSI, dBm", "range": "range minus distance, m"}


def draw(world: World, calibrations: Sequence[RadioCalibration]) -> Figure:
    """A row of two panels for each kind of readings."""
    figure, axes = panels(2 * len(calibrations), 3.8, columns=2)
    for each, line, left in zip(calibrations, axes[0::2], axes[1::2], strict=True):
        _draw_line(line, world, each)
        _draw_left(left, world, each)
        if each.kind == "rssi":
            for one in (line, left):
                one.set_xscale("log")
                plain_ticks(one.xaxis)
    return figure


def _draw_line(axes: Axes, world: World, calibration: RadioCalibration) -> None:
    label(axes, f"{calibration.kind}: places and the common line", "distance, m", VALUES[calibration.kind])
    distances, reach = _distances(calibration), np.geomspace(*_ends(calibration), 200)
    medians, line = calibration.medians, calibration.line
    off = 1.0 if calibration.kind == "range" else 0.0  # over metres of range, its error cannot be seen
    for i, anchor in enumerate(world.anchors):
        rows = medians.anchor == i
        if rows.any():
            colour, at = plain(anchor_colour(world, anchor.id)), distances[rows]
            axes.plot(at, medians.value[rows] - off * at, ".", color=colour, markersize=4, label=anchor.id)
            model = calibrated(anchor.model(calibration.kind), line.gain, float(line.levels[i]))
            axes.plot(reach, model.expected(reach) - off * reach, color=colour, linewidth=1.0)
    axes.legend(fontsize=7, ncols=2)


def _draw_left(axes: Axes, world: World, calibration: RadioCalibration) -> None:
    unit, line, medians = UNITS[calibration.kind], calibration.line, calibration.medians
    label(axes, f"Residuals; σ between places {line.place_std:.2g} {unit}", "distance, m", f"residual, {unit}")
    left = medians.value - line.gain * medians.gain - line.levels[medians.anchor]
    distances = _distances(calibration)
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    for sign in (-2.0, 2.0):
        axes.axhline(sign * line.place_std, color="0.6", linewidth=0.8, linestyle="--")
    for i, anchor in enumerate(world.anchors):
        rows = medians.anchor == i
        axes.plot(distances[rows], left[rows], ".", color=plain(anchor_colour(world, anchor.id)), markersize=4)


def _distances(calibration: RadioCalibration) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Mean distance of each median [m]."""
    readings, medians = calibration.readings, calibration.medians
    most = int(readings.place.max()) + 1
    keys, row = np.unique(readings.anchor * most + readings.place, return_inverse=True)
    mean = np.bincount(row, readings.distance_m) / np.bincount(row)
    return np.asarray(mean[np.searchsorted(keys, medians.anchor * most + medians.place)])


def _ends(calibration: RadioCalibration) -> tuple[float, float]:
    distance = calibration.readings.distance_m
    return max(float(distance.min()), 0.05), float(distance.max())
