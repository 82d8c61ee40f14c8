"""The layout of a review, so that nobody has to click: the map on the left, what went wrong and why on the right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.colours import GROUND
from benchmarks.lane import Lane
from fusion import Ranges, WifiScan
from fusion.values import seconds
from logs.run import Run

TIMELINE = "t"
"""Time since the run's first message."""
SHOWN = 6
"""Tracks that are switched on, the best ones: more cannot be told apart. The eye beside an entity shows the others."""
TRAIL_S = 10.0
"""How far back the strong part of a track goes."""
MARGIN = 0.06
"""Free space around the floor, as a share of its width."""
LEGEND = 0.24
"""Room for the legend to the right of the floor, as a share of its width."""
NIS_SHOWN = 12.0
"""Top of the NIS plot: three times the 95 % limit."""


class Frame(NamedTuple):
    """The part of the map [m] and of time [ns] that is shown."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    start_ns: int
    end_ns: int

    @classmethod
    def around(cls, run: Run) -> Frame:
        """The floor with all anchors and the true path, from the first message to the last."""
        bounds, anchors = run.world.bounds, run.world.anchors
        xs = [bounds.x_min, bounds.x_max, *(anchor.x for anchor in anchors)]
        ys = [bounds.y_min, bounds.y_max, *(anchor.y for anchor in anchors)]
        stamps = [measurement.time_ns for measurement in run.measurements]
        if run.truth is not None:
            known = np.isfinite(run.truth.x) & np.isfinite(run.truth.y)
            xs += run.truth.x[known].tolist()
            ys += run.truth.y[known].tolist()
            stamps += run.truth.time_ns[known].tolist()
        return cls(min(xs), max(xs), min(ys), max(ys), min(stamps, default=0), max(stamps, default=0))

    @property
    def duration_s(self) -> float:
        """Length of the run [s]."""
        return seconds(self.end_ns - self.start_ns)

    def legend(self, count: int) -> list[tuple[float, float]]:
        """Places [m] for that many entries, from the top down."""
        x = self.x_max + 0.6 * LEGEND * (self.x_max - self.x_min)
        step = (self.y_max - self.y_min) / max(count, 8)
        return [(x, self.y_max - (i + 0.5) * step) for i in range(count)]


def blueprint(frame: Frame, run: Run, ranking: Sequence[Lane]) -> Any:  # noqa: ANN401 - Rerun's own value
    """The layout for the lanes of ``ranking``, the best first."""
    import rerun.blueprint as rrb

    left = rrb.Vertical(_map(frame, run, ranking), _scores(), row_shares=[3, 1.3])
    right = rrb.Vertical(_errors(frame), _readings(frame, run), _fates(frame, ranking), row_shares=[2.2, 1.5, 2.3])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
        collapse_panels=True,
        auto_layout=False,
        auto_views=False,
    )


def _map(frame: Frame, run: Run, ranking: Sequence[Lane]) -> Any:  # noqa: ANN401
    import rerun.blueprint as rrb

    width, margin = frame.x_max - frame.x_min, MARGIN * (frame.x_max - frame.x_min)
    # Rerun's 2D views look down their y axis: the map is mirrored into them, and so are its bounds.
    bounds = rrb.VisualBounds2D(
        x_range=[frame.x_min - margin, frame.x_max + LEGEND * width],
        y_range=[-frame.y_max - margin, -frame.y_min + margin],
    )
    return rrb.Spatial2DView(
        name=f"{run.name}: tracks (m, y up), 95 % ellipses",
        origin="/",
        contents="/map/**",
        background=list(GROUND),
        visual_bounds=bounds,
        overrides=_overrides(ranking),
    )


def _overrides(ranking: Sequence[Lane]) -> dict[Any, Any]:
    """Trails reach back from the cursor; the tracks of all but the best are switched off."""
    import rerun as rr
    import rerun.blueprint as rrb

    now = rrb.TimeRangeBoundary.cursor_relative
    trail = rrb.VisibleTimeRanges([rrb.VisibleTimeRange(TIMELINE, start=now(seconds=-TRAIL_S), end=now(seconds=0.0))])
    places = [["map", "estimate", lane.name] for lane in ranking]
    overrides = {rr.new_entity_path([*place, "trail"]): trail for place in [["map", "truth"], *places]}
    hidden = rrb.EntityBehavior(visible=False)
    return overrides | {rr.new_entity_path(place): hidden for place in places[SHOWN:]}


def _scores() -> Any:  # noqa: ANN401
    import rerun.blueprint as rrb

    return rrb.TextDocumentView(name="Scores, the best first", origin="/scores")


def _plot(frame: Frame, name: str, origin: str, *, top: float | None = None, legend: bool = True) -> Any:  # noqa: ANN401
    """A plot of the whole run, not only of half a minute around the cursor; ``top``: its values are in [0, top]."""
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.blueprint.archetypes import PlotBackground

    edge = rrb.TimeRangeBoundary.absolute
    whole_run = rr.TimeRange(start=edge(seconds=0.0), end=edge(seconds=max(frame.duration_s, 1.0)))
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=rrb.TimeAxis(view_range=whole_run),
        axis_y=None if top is None else rrb.ScalarAxis(range=(-0.04 * top, 1.04 * top)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend),
        background=PlotBackground(color=list(GROUND)),
    )


def _errors(frame: Frame) -> Any:  # noqa: ANN401
    import rerun.blueprint as rrb

    heading = _plot(frame, "Heading error (°)", "/heading_error")
    return rrb.Tabs(_plot(frame, "Position error (m)", "/error"), heading, active_tab=0)


def _readings(frame: Frame, run: Run) -> Any:  # noqa: ANN401
    """A tab for each kind of radio reading the run holds."""
    import rerun.blueprint as rrb

    kinds = {type(measurement) for measurement in run.measurements}
    views = [_plot(frame, "Ranges (m)", "/ranges")] if Ranges in kinds else []
    if WifiScan in kinds or not views:
        views.append(_plot(frame, "Signal strength (dBm)", "/rssi"))
    return rrb.Tabs(contents=views, active_tab=0)


def _fates(frame: Frame, ranking: Sequence[Lane]) -> Any:  # noqa: ANN401
    """A tab for each estimator that hears the radio: how far it believed each reading, and how surprising it was.

    The best estimator that tells both is in front.
    """
    import rerun as rr
    import rerun.blueprint as rrb

    tabs = []
    for lane in sorted(ranking, key=lambda lane: not _tells_nis(lane)):
        if not any(update.fates for update in lane.updates):
            continue
        name = lane.name
        weight = f"{name}: weight of readings, coloured as above"
        views = [_plot(frame, weight, rr.new_entity_path(["weight", name]), top=1.0, legend=False)]
        if _tells_nis(lane):
            nis = f"{name}: NIS of readings; the line is exceeded once in twenty"
            views.append(_plot(frame, nis, rr.new_entity_path(["nis", name]), top=NIS_SHOWN, legend=False))
        tabs.append(rrb.Vertical(*views, name=name))
    return rrb.Tabs(contents=tabs, active_tab=0) if tabs else _plot(frame, "Weight of readings", "/weight")


def _tells_nis(lane: Lane) -> bool:
    return any(fate.nis is not None for update in lane.updates for fate in update.fates)
