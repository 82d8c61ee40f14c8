"""The single views of a review, each with its background and its whole range given: the viewer's own guesses differ
between desktop and web.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.review.cdf import WIDTH
from benchmarks.review.drawing import Drawing
from benchmarks.review.frame import LEGEND, MARGIN, TIMELINE, Frame
from fusion.output.colours import GROUND
from logs.run import Run

TRAIL_S = 10.0
"""Length of the strong part of a track, back from the cursor."""


def tabs(views: Sequence[Any]) -> Any:  # noqa: ANN401 - Rerun's own values, here and below
    """Views behind each other, the first in front; a single one needs no tab."""
    import rerun.blueprint as rrb

    return views[0] if len(views) == 1 else rrb.Tabs(contents=views, active_tab=0)


def map_view(frame: Frame, run: Run, drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401
    """The floor from above with all tracks."""
    import rerun.blueprint as rrb

    width, margin = frame.x_max - frame.x_min, MARGIN * (frame.x_max - frame.x_min)
    # Rerun's 2D views look down their y axis: the map is mirrored into them, and so are its bounds.
    bounds = rrb.VisualBounds2D(
        x_range=[frame.x_min - margin, frame.x_max + LEGEND * width],
        y_range=[-frame.y_max - margin, -frame.y_min + margin],
    )
    return rrb.Spatial2DView(
        name=_map_title(run, drawn),
        origin="/",
        contents="/map/**",
        background=list(GROUND),
        visual_bounds=bounds,
        overrides=_overrides(frame, drawn),
    )


def _map_title(run: Run, drawn: Sequence[Drawing]) -> str:
    """The title of the map, with the estimator whose decisions colour the circles."""
    judge = next((drawing.name for drawing in drawn if drawing.gates), None)
    circles = "" if judge is None else f", circles: readings, yellow where {judge} took them"
    return f"{run.name}: tracks (m, y up), 95 % ellipses{circles}"


def _overrides(frame: Frame, drawn: Sequence[Drawing]) -> dict[Any, Any]:
    """Trails reach back from the cursor; tracks beyond the best are off, and so are all circles but the first's."""
    import rerun as rr
    import rerun.blueprint as rrb

    now = rrb.TimeRangeBoundary.cursor_relative
    lately = rr.TimeRange(start=now(seconds=-TRAIL_S), end=now(seconds=0.0))
    trail = rrb.VisibleTimeRanges([rrb.VisibleTimeRange(timeline, lately) for timeline in frame.timelines])
    hidden = rrb.EntityBehavior(visible=False)
    overrides: dict[Any, Any] = {rr.new_entity_path(["map", "truth", "trail"]): trail}
    circles = next((drawing.name for drawing in drawn if drawing.gates), None)
    for drawing in drawn:
        place = ["map", "estimate", drawing.name]
        overrides[rr.new_entity_path([*place, "trail"])] = trail
        if not drawing.shown:
            overrides[rr.new_entity_path(place)] = hidden
        if drawing.name != circles:
            overrides[rr.new_entity_path([*place, "readings"])] = hidden
    return overrides


def score_view() -> Any:  # noqa: ANN401
    """The score table."""
    import rerun.blueprint as rrb

    return rrb.TextDocumentView(name="Scores, the best first (cm, °, %, µs a message, s)", origin="/scores")


def cdf_view(drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401
    """The distribution of errors."""
    import rerun as rr
    import rerun.blueprint as rrb

    hidden = rrb.EntityBehavior(visible=False)
    off: dict[Any, Any] = {
        rr.new_entity_path(["cdf", "estimate", drawing.name]): hidden for drawing in drawn if not drawing.shown
    }
    return rrb.Spatial2DView(
        name="Error CDF (m)",  # short, for the score table beside it leaves a small window little room
        origin="/",
        contents="/cdf/**",
        background=list(GROUND),
        visual_bounds=rrb.VisualBounds2D(x_range=[-0.27, WIDTH + 0.17], y_range=[-1.06, 0.16]),
        overrides=off,
    )


def _whole_run() -> Any:  # noqa: ANN401
    """All of the run on any timeline, not only half a minute around the cursor."""
    import rerun as rr
    import rerun.blueprint as rrb

    edge = rrb.TimeRangeBoundary.infinite
    whole = rr.TimeRange(start=edge(), end=edge())
    return rrb.TimeAxis(view_range=whole)


def upward(top: float) -> tuple[float, float]:
    """The span of an axis whose values are in [0, top]."""
    return -0.04 * top, 1.04 * top


def plot(name: str, origin: str, *, span: tuple[float, float] | None = None, legend: bool = True) -> Any:  # noqa: ANN401
    """A plot of the whole run; ``span``: from where to where its values go, by what the viewer sees if None."""
    import rerun.blueprint as rrb
    from rerun.blueprint.archetypes import PlotBackground

    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=_whole_run(),
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend),
        background=PlotBackground(color=list(GROUND)),
    )


def state_view(drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401
    """A row for each estimator, coloured by its state."""
    import rerun as rr
    import rerun.blueprint as rrb

    return rrb.StateTimelineView(
        name="Was the last scan taken?",
        origin="/state",
        contents=[rr.new_entity_path(["state", drawing.name]) for drawing in drawn],
        time_view=_whole_run(),
    )


def table_view(drawn: Sequence[Drawing]) -> Any:  # noqa: ANN401
    """The position errors as numbers."""
    import rerun as rr
    import rerun.blueprint as rrb

    columns: list[Any] = [TIMELINE]
    for drawing in (drawing for drawing in drawn if drawing.instants is not None):
        place = rr.new_entity_path(["error", drawing.name])
        columns.append(rrb.components.ComponentColumnSelector(entity_path=place, component="Scalars:scalars"))
    query = rrb.archetypes.DataframeQuery(timeline=TIMELINE, select=columns)
    return rrb.DataframeView(name="Position error (m)", origin="/", contents="/error/**", query=query)


def event_view(name: str) -> Any:  # noqa: ANN401
    """Events of one estimator, or of the devices, line by line."""
    import rerun as rr
    import rerun.blueprint as rrb

    # The time stands in the text: its own column is drawn too narrow to be read.
    no_time = rrb.encodings.TimelineColumn(TIMELINE, visible=False)
    columns = rrb.TextLogColumns(timeline_columns=[no_time], text_log_columns=["loglevel", "body"])
    return rrb.TextLogView(name=f"{name}: events", origin=rr.new_entity_path(["events", name]), columns=columns)
