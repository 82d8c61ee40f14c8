"""The layout of a review: pages, and on the first the map on the left, errors and their causes on the right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.metrics.score import quantile
from benchmarks.review.drawing import SHOWN, Drawing
from benchmarks.review.estimator_plots import AXES
from benchmarks.review.events import State
from benchmarks.review.frame import TIMELINE, Frame
from benchmarks.review.raw_sensors import DEVICES, SPEED, TURN_RATE, worth_a_line
from benchmarks.review.views import (
    cdf_view,
    event_view,
    map_view,
    plot,
    score_view,
    state_view,
    table_view,
    tabs,
    upward,
)
from fusion import Ranges, WifiScan
from logs.run import Run

NIS_SHOWN = 12.0
"""Top of the NIS plot: three times the 95 % limit."""
NEES_SHOWN = 30.0
"""Least top of the NEES plot: three times the upper bound."""


def blueprint(frame: Frame, run: Run, drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401 - Rerun's own value
    """The layout for the estimators ``drawn``, the best first."""
    import rerun.blueprint as rrb

    pages = [_overview(frame, run, drawn), _readings(run, drawn), _motion(run)]
    pages += [rrb.Vertical(table_view(drawn), name="Table")] if run.truth is not None else []
    return rrb.Blueprint(
        rrb.Tabs(*pages, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
        collapse_panels=True,
        auto_layout=False,
        auto_views=False,
    )


def _overview(frame: Frame, run: Run, drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401
    import rerun.blueprint as rrb

    has_truth = run.truth is not None
    scores = rrb.Horizontal(score_view(), cdf_view(drawn), column_shares=[7, 3]) if has_truth else score_view()
    left = rrb.Vertical(map_view(frame, run, drawn), scores, row_shares=[2, 1])
    # More names than that hide the plot; the map's own legend stands beside it.
    titles = {"Position error (m)": "/error", "Heading error (°)": "/heading_error"}
    errors = [plot(title, origin, legend=len(drawn) <= SHOWN) for title, origin in titles.items()]
    details = _details(drawn)
    right = [(tabs(errors), 2.0)] if has_truth else []
    right += [_reception(run, drawn)]
    right += [(tabs(details), 3.6)] if details else []
    views, shares = zip(*right, strict=True)
    return rrb.Horizontal(left, rrb.Vertical(*views, row_shares=shares), column_shares=[3, 2], name="Overview")


def _reception(run: Run, drawn: Sequence[Drawing]) -> tuple[Any, float]:
    """Radio readings and the states that followed, and the height of both; states in front where any was refused."""
    judged = [drawing for drawing in drawn if drawing.shown and not drawing.is_counterfactual and drawing.states.state]
    state = [state_view(judged)] if judged else []
    eventful = any(state in (State.REJECT, State.LOST) for drawing in judged for state in drawing.states.state)
    if eventful:
        return tabs(state + _radio(run)), max(1.5, 0.6 + 0.28 * len(judged))
    return tabs(_radio(run) + state), 1.8


def _radio(run: Run) -> list[Any]:
    """A plot for each kind of radio reading the run holds."""
    kinds = {type(measurement) for measurement in run.measurements}
    plots = [plot("Ranges (m)", "/ranges")] if Ranges in kinds else []
    if WifiScan in kinds or not plots:
        plots.append(plot("Signal strength (dBm)", "/rssi"))
    return plots


def _details(drawn: Sequence[Drawing]) -> list[Any]:
    """A tab for each estimator: its error on the claimed one, and its events."""
    import rerun.blueprint as rrb

    details = []
    for drawing in (drawing for drawing in drawn if not drawing.is_counterfactual):
        name, views = drawing.name, []
        if drawing.has_variance:
            views.append(tabs(_component_errors(drawing)))
        # Behind each other, for four plots in a column are too low for the numbers on their axes.
        honesty = _honesty(drawing)
        views += [tabs(honesty)] if honesty else []
        views += [event_view(name)] if drawing.events.text else []
        if views:
            details.append(rrb.Vertical(*views, name=name))
    return details


def _component_errors(drawing: Drawing) -> list[Any]:
    """Each component of the error on what is claimed of it, all of either inside the plot."""
    import rerun as rr

    plots = []
    for number, axis in enumerate(AXES):
        title, place = f"{axis.name} error and ±1σ ({axis.unit})", ["consistency", drawing.name, axis.name]
        low, high = (axis.factor * end for end in reach(drawing, number))
        plots.append(plot(title, rr.new_entity_path(place), span=(low, high) if low < high else None, legend=False))
    return plots


def reach(drawing: Drawing, number: int) -> tuple[float, float]:
    """From where to where a component of the error goes [m or rad], with the band of nine tenths of the claims: the
    viewer looks at the errors alone, and a filter that does not know where it is may claim anything.
    """
    if drawing.errors is None:
        return 0.0, 0.0
    error, variance = drawing.errors.error[:, number], drawing.errors.variance[:, number]
    error, claimed = error[np.isfinite(error)], np.sqrt(variance[np.isfinite(variance)])
    band = quantile(claimed, 0.9) if len(claimed) else 0.0
    low, high = float(error.min(initial=-band)), float(error.max(initial=band))
    margin = 0.05 * (high - low)
    return low - margin, high + margin


def _honesty(drawing: Drawing) -> list[Any]:
    """NEES, and of a cloud how many particles count."""
    import rerun as rr

    name, views = drawing.name, []
    if drawing.has_variance:
        title = f"{name}: NEES; 95 % should lie between the lines"
        views.append(plot(title, rr.new_entity_path(["nees", name]), span=upward(_nees_top(drawing)), legend=False))
    if drawing.reviewed.clouds is not None:
        views.append(plot(f"{name}: effective particles", rr.new_entity_path(["neff", name]), legend=False))
    return views


def _nees_top(drawing: Drawing) -> float:
    """High enough for nine tenths of a filter's NEES, and for its bounds."""
    errors = drawing.score.errors
    nees = np.array([]) if errors is None else errors.nees[np.isfinite(errors.nees)]
    return max(NEES_SHOWN, quantile(nees, 0.9)) if len(nees) else NEES_SHOWN


def _readings(run: Run, drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401
    """The radio in full: all readings, and the weight that each estimator gave them."""
    import rerun as rr
    import rerun.blueprint as rrb

    gates = []
    for drawing in (drawing for drawing in drawn if drawing.gates):
        name = drawing.name
        weight = f"{name}: weight of readings, coloured as above"
        views = [plot(weight, rr.new_entity_path(["weight", name]), span=upward(1.0), legend=False)]
        if drawing.has_nis:
            nis = f"{name}: NIS of readings; the line is exceeded once in twenty"
            views.append(plot(nis, rr.new_entity_path(["nis", name]), span=upward(NIS_SHOWN), legend=False))
        gates.append(rrb.Vertical(*views, name=name))
    return rrb.Vertical(*_radio(run), *([tabs(gates)] if gates else []), name="Radio")


def _motion(run: Run) -> Any:  # noqa: ANN401
    """The motion sensors as they came, and events of the devices, where a recorder logged them."""
    import rerun.blueprint as rrb

    speeds = plot("Speed (m/s)", f"/raw/{SPEED}")
    devices = [event_view(DEVICES)] if worth_a_line(run) else []
    return rrb.Vertical(speeds, plot("Turn rate (°/s)", f"/raw/{TURN_RATE}"), *devices, name="Motion")
