"""The canvas of a review: one Rerun recording, written in whole columns.

A row sent alone costs two hundred times more than a row in a column; only what holds at all times is logged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.review.frame import TIMELINE, UTC
from fusion.arrays import Floats, Stamps
from fusion.output.colours import Colour
from fusion.values import NANOSECONDS

MOST_POSES = 6000
"""Poses of one drawn track: more cost the viewer time and show nothing. Scores are never thinned."""
FAINT, STRONG = 80, 255
"""Opacity of whole tracks and of what is at the time cursor."""

Place = Sequence[str]
"""An entity's place in the recording, part by part: a part may hold any character."""
Rows = TypeVar("Rows", NDArray[np.int64], Floats)


class Canvas(NamedTuple):
    """The Rerun module, its recording, the time that counts as zero, and the timelines there are."""

    rr: Any
    recording: Any
    start_ns: int
    timelines: tuple[str, ...] = (TIMELINE,)

    def style(self, path: Place, *archetypes: Any) -> None:  # noqa: ANN401 - Rerun's own values
        """Log values that hold at all times."""
        self.recording.log(self.rr.new_entity_path(list(path)), *archetypes, static=True)

    def columns(self, path: Place, time_ns: Stamps, *columns: Any) -> None:  # noqa: ANN401
        """One row per time [ns]."""
        indexes = [self.rr.TimeColumn(TIMELINE, duration=(time_ns - self.start_ns).astype("timedelta64[ns]"))]
        if UTC in self.timelines:
            indexes.append(self.rr.TimeColumn(UTC, timestamp=time_ns.astype("datetime64[ns]")))
        for column in columns:
            self.recording.send_columns(self.rr.new_entity_path(list(path)), indexes, column)

    def dots(self, path: Place, name: str, colour: Colour, time_ns: Stamps, values: Floats) -> None:
        """A dot per (time [ns], value)."""
        look = self.rr.SeriesPoints.from_fields(names=[name], colors=[colour], marker_sizes=[2.0])
        self._series(path, look, time_ns, values)

    def line(
        self,
        path: Place,
        name: str,
        colour: Colour,
        time_ns: Stamps,
        values: Floats,
        *,
        width: float = 1.5,
        shown: bool = True,
        merge: str = "MinMaxAverage",
    ) -> None:
        """A line through (time [ns], value), broken where a value is not finite; not shown: off in the legend.

        ``merge``: what the viewer makes of rows that share a pixel. Its own choice, their mean, hides the worst.
        """
        look: dict[str, Any] = {"names": [name], "colors": [colour], "widths": [width], "visible_series": [shown]}
        look["aggregation_policy"] = getattr(self.rr.components.AggregationPolicy, merge)
        self._series(path, self.rr.SeriesLines.from_fields(**look), time_ns, values)

    def _series(self, path: Place, look: Any, time_ns: Stamps, values: Floats) -> None:  # noqa: ANN401
        finite = np.isfinite(values)
        if finite.any():
            self.style(path, look)
            self.columns(path, time_ns, self.rr.Scalars.columns(scalars=np.where(finite, values, np.nan)))

    def text(self, path: Place, time_ns: Stamps, level: Sequence[str], text: Sequence[str]) -> None:
        """Lines of a log, each with its time since the start: the viewer's own column is drawn too narrow."""
        since_start_s = ((time_ns - self.start_ns) / NANOSECONDS).tolist()
        lines = [f"{at_s:.1f} s  {line}" for at_s, line in zip(since_start_s, text, strict=True)]
        self.columns(path, time_ns, self.rr.TextLog.columns(text=lines, level=list(level)))

    def label(
        self, path: Place, text: str, colour: Colour, place: tuple[float, float], *, radius: float = -6.0
    ) -> None:
        """A labelled dot at all times; negative radii are pixels."""
        look = {"colors": [colour], "radii": [radius], "labels": [text], "show_labels": True}
        self.style(path, self.rr.Points2D([place], **look))


def thinned(rows: Rows) -> Rows:
    """Every n-th of ``rows``, at most `MOST_POSES` of them."""
    return rows[:: max(math.ceil(len(rows) / MOST_POSES), 1)]


JUMP_M_S = 5.0
"""No indoor robot is this fast: a track that is, jumps."""


def draw_path(
    canvas: Canvas, place: Place, colour: Colour, time_ns: Stamps, xy: Floats, *, thickness: float = 1.0
) -> None:
    """Positions ``xy`` (n, 2) [m]; the layout determines how far back the strong part goes."""
    rr = canvas.rr
    time_ns, xy = thinned(time_ns), thinned(xy)
    if len(xy) == 0:
        return
    faint = {"colors": [(*colour, FAINT)], "radii": [-thickness], "draw_order": -5}
    path = rr.Points2D(xy, **faint) if mostly_jumps(time_ns, xy) else rr.LineStrips2D([xy], **faint)
    canvas.style([*place, "path"], path)
    for part, radius in (("trail", -2.0), ("pose", -6.0)):
        look = {"colors": [(*colour, STRONG)], "radii": [radius * thickness]}
        canvas.style([*place, part], rr.Points2D.from_fields(**look))
        canvas.columns([*place, part], time_ns, rr.Points2D.columns(positions=xy))


def mostly_jumps(time_ns: Stamps, xy: Floats) -> bool:
    """True where most of a path's length is jumps, as of a method without memory: lines there would hide the map."""
    steps_m, steps_s = np.hypot(*np.diff(xy, axis=0).T), np.diff(time_ns) / NANOSECONDS
    return bool(steps_m[steps_m > JUMP_M_S * steps_s].sum() > 0.5 * steps_m.sum())
