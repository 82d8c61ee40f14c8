"""One estimator over time: its errors, whether they fit what it claims, and what it made of the readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.review.canvas import Canvas
from benchmarks.review.drawing import Drawing
from benchmarks.review.events import State
from benchmarks.review.frame import Frame
from fusion import Reason, World
from fusion.arrays import Floats, Stamps
from fusion.output.colours import LOST, REFUSED, TAKEN, TRUTH, UNSURE, anchor_colour

NIS_LIMIT = 3.841458820694124
"""95 % point of the NIS of one scalar reading, if the filter is honest (chi-square, one degree)."""
NEES_BOUNDS = {2: (0.05063561596857975, 7.377758908227871), 3: (0.21579528262389785, 9.348403604496148)}
"""Between them lie 95 % of the NEES of an honest filter, 2.5 % on either side (chi-square of 2 and 3 degrees)."""
STATE_COLOURS = {State.INIT: UNSURE, State.ACCEPT: TAKEN, State.REJECT: REFUSED, State.LOST: LOST}


class Axis(NamedTuple):
    """One component of the error: what it is called, and the factor from SI to the unit that a person reads."""

    name: str
    unit: str
    factor: float


AXES = (Axis("x", "m", 1.0), Axis("y", "m", 1.0), Axis("heading", "°", float(np.degrees(1.0))))


def draw_over_time(canvas: Canvas, world: World, frame: Frame, drawing: Drawing) -> None:
    """All plots of one estimator; of a counterfactual the errors alone."""
    _draw_errors(canvas, drawing)
    if not drawing.is_counterfactual:
        _draw_consistency(canvas, drawing)
        _draw_nees(canvas, drawing)
        _draw_effective_number(canvas, drawing)
        _draw_gating(canvas, world, frame, drawing)
        _draw_states(canvas, drawing)
        _draw_events(canvas, drawing)


def _draw_errors(canvas: Canvas, drawing: Drawing) -> None:
    """Position error [m] and heading error [deg] at the instants the bench judges."""
    if drawing.instants is None or drawing.score.errors is None:
        return
    name, colour, time_ns = drawing.name, drawing.colour, drawing.instants.time_ns
    width, shown = 0.75 if drawing.is_counterfactual else 1.5, drawing.shown
    position, heading = drawing.score.errors.position, np.degrees(drawing.score.errors.heading)
    canvas.line(["error", name], name, colour, time_ns, position, width=width, shown=shown, merge="Max")
    canvas.line(["heading_error", name], name, colour, time_ns, heading, width=width, shown=shown, merge="Max")


def _draw_consistency(canvas: Canvas, drawing: Drawing) -> None:
    """Each component of the error over the band of one standard deviation that the estimator claims for it."""
    if drawing.instants is None or drawing.errors is None:
        return
    rr, time_ns = canvas.rr, drawing.instants.time_ns
    for axis, values, squares in zip(AXES, drawing.errors.error.T, drawing.errors.variance.T, strict=True):
        claimed = np.isfinite(squares)
        if not claimed.any():
            continue
        place = ["consistency", drawing.name, axis.name]
        canvas.style([*place, "claim"], rr.Measurements.from_fields(names=["±1σ claimed"], colors=[drawing.colour]))
        band = {"values": np.where(claimed, 0.0, np.nan), "variances": squares * axis.factor**2}
        canvas.columns([*place, "claim"], time_ns, rr.Measurements.columns(**band))
        canvas.line([*place, "error"], "error", TRUTH, time_ns, values * axis.factor)


def _draw_nees(canvas: Canvas, drawing: Drawing) -> None:
    """NEES between its bounds, which depend on whether a heading is judged."""
    errors = drawing.score.errors
    if drawing.instants is None or errors is None or not drawing.has_variance:
        return
    time_ns, place = drawing.instants.time_ns, ["nees", drawing.name]
    canvas.line([*place, "NEES"], "NEES", drawing.colour, time_ns, errors.nees, merge="Max")
    for number, end in enumerate(("lower", "upper")):
        bound = np.where(errors.dimension == 3, NEES_BOUNDS[3][number], NEES_BOUNDS[2][number])
        canvas.line([*place, end], f"95 % {end}", TRUTH, *corners(time_ns, bound), width=1.0, merge="Off")


def _draw_effective_number(canvas: Canvas, drawing: Drawing) -> None:
    clouds = drawing.reviewed.clouds
    if clouds is not None:
        look = (["neff", drawing.name], "effective particles", drawing.colour)
        canvas.line(*look, clouds.time_ns, clouds.effective_number)


def corners(time_ns: Stamps, values: Floats) -> tuple[Stamps, Floats]:
    """The rows of a step-wise constant column that matter: the first, the last, and both sides of each step."""
    step = np.flatnonzero(np.diff(values))
    chosen = np.unique(np.concatenate([[0], step, step + 1, [len(values) - 1]]))
    return time_ns[chosen], values[chosen]


def _draw_gating(canvas: Canvas, world: World, frame: Frame, drawing: Drawing) -> None:
    """Weight and NIS of every reading, one series per anchor; a reading without anchor goes by its sensor."""
    fates, name = drawing.fates, drawing.name
    consumed, source = ~fates.met(Reason.KIND_NOT_CONSUMED), fates.source
    for code in np.unique(source[consumed]).tolist():
        own, anchor = consumed & (source == code), str(fates.names[code])
        colour = anchor_colour(world, anchor)
        canvas.dots(["weight", name, anchor], anchor, colour, fates.time_ns[own], fates.weight[own])
        canvas.dots(["nis", name, anchor], anchor, colour, fates.time_ns[own], fates.nis[own])
    if drawing.has_nis:
        edges = np.array([frame.start_ns, frame.end_ns])
        canvas.line(["nis", name, "95 % limit"], "95 % limit", TRUTH, edges, np.full(2, NIS_LIMIT))


def _draw_states(canvas: Canvas, drawing: Drawing) -> None:
    changes = drawing.states
    if not changes.state:
        return
    rr, place = canvas.rr, ["state", drawing.name]
    look = {"values": [state.name for state in State], "colors": [STATE_COLOURS[state] for state in State]}
    canvas.style(place, rr.StateConfiguration(**look))
    canvas.columns(place, changes.time_ns, rr.StateChange.columns(state=[state.name for state in changes.state]))


def _draw_events(canvas: Canvas, drawing: Drawing) -> None:
    events = drawing.events
    if events.text:
        canvas.text(["events", drawing.name], events.time_ns, events.level, events.text)
