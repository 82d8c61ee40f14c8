"""The layer of a review that is the same for all estimators: the floor, the true path, the readings as they came."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.review.canvas import Canvas, draw_path, thinned
from benchmarks.review.cdf import LEAST_M, CdfAxes, draw_axes, round_step
from benchmarks.review.frame import MARGIN, Frame
from benchmarks.review.radio_circles import ReadingColumns
from benchmarks.review.raw_sensors import draw_device_events, draw_raw_sensors, raw_series, worth_a_line
from fusion import World
from fusion.arrays import Floats, Stamps
from fusion.output.colours import ANCHOR, TRUTH, WALL, anchor_colour
from logs.run import Run
from logs.truth import TruthTrack

ARROW_M = 0.75
"""Length of the arrow that shows the true heading."""


def draw_base(
    canvas: Canvas, run: Run, frame: Frame, readings: ReadingColumns, axes: CdfAxes | None, legend: tuple[float, float]
) -> None:
    """The base layer; ``axes``: of the error distribution, None without truth; ``legend``: the truth's place in it."""
    _draw_floor(canvas, run.world)
    _draw_scale(canvas, frame)
    if run.truth is not None:
        canvas.label(["map", "legend", "truth"], "truth", TRUTH, legend)
        _draw_truth(canvas, run.truth)
    _draw_readings(canvas, run.world, readings)
    draw_raw_sensors(canvas, raw_series(run.world, run.measurements))
    draw_device_events(canvas, worth_a_line(run))
    if axes is not None:
        draw_axes(canvas, axes)


def properties(run: Run, frame: Frame) -> dict[str, Any]:
    """Properties of the recording, which the viewer shows when it is selected."""
    return {
        "log": str(run.path),
        "world": run.world.name,
        "world_hash": run.world.hash,
        "start_ns": frame.start_ns,
        "duration_s": frame.duration_s,
        "measurements": len(run.measurements),
        "warnings": list(run.warnings) or ["none"],
    }


def _draw_floor(canvas: Canvas, world: World) -> None:
    """Walls and anchors. The map is mirrored into the view, so that y points up."""
    rr, bounds = canvas.rr, world.bounds
    canvas.style(["map"], rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0])))
    low, high = (bounds.x_min, bounds.y_min), (bounds.x_max, bounds.y_max)
    border = [low, (high[0], low[1]), high, (low[0], high[1]), low]
    walls = [list(wall) for wall in world.walls]
    radii = [-1.0] + [-2.0] * len(walls)
    canvas.style(["map", "walls"], rr.LineStrips2D([border, *walls], colors=[WALL], radii=radii, draw_order=-20))
    for anchor in world.anchors:
        canvas.label(["map", "anchor", anchor.id], anchor.id, ANCHOR, (anchor.x, anchor.y))


def _draw_scale(canvas: Canvas, frame: Frame) -> None:
    """A bar of a round length below the floor: Rerun's 2D views have no axes."""
    width_m = max(frame.x_max - frame.x_min, LEAST_M)
    length_m = round_step(width_m / 4.0)
    y = frame.y_min - 0.3 * MARGIN * width_m
    bar = [(frame.x_min, y), (frame.x_min + length_m, y)]
    look = {"colors": [TRUTH], "radii": [-1.0], "labels": [f"{length_m:g} m"], "show_labels": True}
    canvas.style(["map", "scale"], canvas.rr.LineStrips2D([bar], **look))


def _draw_truth(canvas: Canvas, truth: TruthTrack) -> None:
    known = np.flatnonzero(np.isfinite(truth.x) & np.isfinite(truth.y))
    xy = np.column_stack([truth.x, truth.y])[known]
    draw_path(canvas, ["map", "truth"], TRUTH, truth.time_ns[known], xy)
    _draw_heading(canvas, truth.time_ns[known], xy, truth.heading[known])


def _draw_heading(canvas: Canvas, time_ns: Stamps, xy: Floats, heading: Floats) -> None:
    """The true heading: an arrow from the true place at the time cursor, none while it is not known."""
    if not np.isfinite(heading).any():
        return
    origins, angle = thinned(xy), thinned(heading)
    known = np.isfinite(angle)
    vectors = ARROW_M * np.column_stack([np.cos(angle), np.sin(angle)])[known]
    rr, place = canvas.rr, ["map", "truth", "heading"]
    canvas.style(place, rr.Arrows2D.from_fields(colors=[TRUTH], radii=[-1.5]))
    arrows = rr.Arrows2D.columns(vectors=vectors, origins=origins[known]).partition(known.astype(np.int64))
    canvas.columns(place, thinned(time_ns), arrows)


def _draw_readings(canvas: Canvas, world: World, readings: ReadingColumns) -> None:
    """Signal strengths [dBm] and ranges [m] as they came, one series per anchor."""
    for kind, chosen in (("rssi", ~readings.is_range), ("ranges", readings.is_range)):
        for anchor in np.unique(readings.anchor[chosen]).tolist():
            own = chosen & (readings.anchor == anchor)
            colour = anchor_colour(world, anchor)
            canvas.dots([kind, anchor], anchor, colour, readings.time_ns[own], readings.value[own])
