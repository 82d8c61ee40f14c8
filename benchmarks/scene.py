"""One run and its estimators as a Rerun recording: the map, the tracks, errors, weights and readings over time.

Whole columns go into the recording, never single rows, which cost two orders of magnitude more. Nothing but drawing
happens here: the numbers are those of the bench.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.blueprint import SHOWN, TIMELINE, Frame, blueprint
from benchmarks.cell import Score
from benchmarks.colours import ANCHOR, GREY, PALETTE, TRUTH, WALL, Colour, colour_of
from benchmarks.instants import evaluation_instants
from benchmarks.lane import Lane
from benchmarks.picture import require_rerun
from benchmarks.score import CHI_SQUARE_95
from benchmarks.table import COLUMNS, as_text, ranked
from fusion import Estimate, Fate, FusionError, Ranges, WifiScan, World
from fusion.values import NANOSECONDS
from logs.run import Run

APPLICATION = "fusion"
MOST_POSES = 6000
"""Poses of one drawn track: more cost the viewer time and show nothing. Scores are never thinned."""
NIS_LIMIT = 3.841458820694124
"""What the NIS of one scalar reading exceeds once in twenty, if the filter is honest (chi-square, one degree)."""
FAINT, STRONG = 80, 255
"""Opacity of whole tracks and of what is at the time cursor."""

JUMP_M_S = 5.0
"""No indoor robot is this fast: a track that is, jumps."""

Times = list[int] | NDArray[np.int64]


class Canvas(NamedTuple):
    """Where things are drawn: the Rerun module, its recording, and the time that counts as zero."""

    rr: Any
    recording: Any
    start_ns: int

    def style(self, path: Sequence[str], *archetypes: Any) -> None:  # noqa: ANN401 - Rerun's own values
        """What holds at all times."""
        self.recording.log(self.rr.new_entity_path(list(path)), *archetypes, static=True)

    def columns(self, path: Sequence[str], time_ns: Times, *columns: Any) -> None:  # noqa: ANN401
        """One row per time [ns]."""
        since_start = (np.asarray(time_ns, dtype=np.int64) - self.start_ns).astype("timedelta64[ns]")
        index = self.rr.TimeColumn(TIMELINE, duration=since_start)
        for column in columns:
            self.recording.send_columns(self.rr.new_entity_path(list(path)), [index], column)

    def plot(self, path: Sequence[str], name: str, colour: Colour, rows: Iterable[tuple[int, float]]) -> None:
        """A dot per (time [ns], value)."""
        self._series(path, self.rr.SeriesPoints.from_fields(names=[name], colors=[colour], marker_sizes=[2.0]), rows)

    def line(
        self, path: Sequence[str], name: str, colour: Colour, rows: Iterable[tuple[int, float]], *, shown: bool = True
    ) -> None:
        """A line through (time [ns], value), broken where a value is not finite; not shown: off in the legend."""
        look = {"names": [name], "colors": [colour], "widths": [1.5], "visible_series": [shown]}
        self._series(path, self.rr.SeriesLines.from_fields(**look), rows)

    def _series(self, path: Sequence[str], look: Any, rows: Iterable[tuple[int, float]]) -> None:  # noqa: ANN401
        values = [(time_ns, value if math.isfinite(value) else math.nan) for time_ns, value in rows]
        if not all(math.isnan(value) for _, value in values):
            self.style(path, look)
            scalars = self.rr.Scalars.columns(scalars=[value for _, value in values])
            self.columns(path, [time_ns for time_ns, _ in values], scalars)


def write_scene(output: Path, run: Run, lanes: Sequence[Lane], scores: Sequence[Score]) -> Path:
    """Write the review of ``run`` as a Rerun file that brings its own layout; ``scores`` are those of ``lanes``.

    Raises `ViewerError` where Rerun is not installed, `FusionError` where the file cannot be written.
    """
    rr = require_rerun()
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.touch()
    except OSError as error:
        raise FusionError(f"{output}: the review cannot be written ({error.strerror}); give another place") from error
    frame = Frame.around(run)
    recording = rr.RecordingStream(APPLICATION, recording_id=f"{run.name} {run.world.hash[:12]}")
    by_name = {lane.name: lane for lane in lanes}
    ranking = [by_name[score.estimator] for score in ranked(scores)]
    recording.save(output, default_blueprint=blueprint(frame, run, ranking))
    recording.send_recording_name(run.name)
    canvas = Canvas(rr, recording, frame.start_ns)
    _draw_floor(canvas, run)
    _draw_legend(canvas, frame, run, ranking)
    _draw_truth(canvas, run)
    _draw_readings(canvas, run)
    for lane, score in zip(lanes, scores, strict=True):
        _draw_track(canvas, lane)
        _draw_errors(canvas, run, score, shown=lane in ranking[:SHOWN])
        _draw_fates(canvas, frame, run.world, lane)
    canvas.style(["scores"], rr.TextDocument(markdown(scores), media_type="text/markdown"))
    recording.flush()
    recording.disconnect()
    return output


def _draw_floor(canvas: Canvas, run: Run) -> None:
    """Walls and anchors. The map is mirrored into the view, so that y points up."""
    rr, bounds = canvas.rr, run.world.bounds
    canvas.style(["map"], rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0])))
    low, high = (bounds.x_min, bounds.y_min), (bounds.x_max, bounds.y_max)
    border = [low, (high[0], low[1]), high, (low[0], high[1]), low]
    walls = [list(wall) for wall in run.world.walls]
    radii = [-1.0] + [-2.0] * len(walls)
    canvas.style(["map", "walls"], rr.LineStrips2D([border, *walls], colors=[WALL], radii=radii, draw_order=-20))
    for anchor in run.world.anchors:
        _draw_label(canvas, ["map", "anchor", anchor.id], anchor.id, ANCHOR, (anchor.x, anchor.y))


def _draw_legend(canvas: Canvas, frame: Frame, run: Run, ranking: Sequence[Lane]) -> None:
    """Names and colours beside the floor: Rerun's own map views have no legend."""
    entries = [] if run.truth is None else [("truth", TRUTH)]
    entries += [
        (lane.name if i < SHOWN else f"{lane.name} (hidden)", colour_of(lane.name)) for i, lane in enumerate(ranking)
    ]
    for (name, colour), place in zip(entries, frame.legend(len(entries)), strict=True):
        _draw_label(canvas, ["map", "legend", name], name, colour, place)


def _draw_label(canvas: Canvas, path: Sequence[str], text: str, colour: Colour, place: tuple[float, float]) -> None:
    point = canvas.rr.Points2D([place], colors=[colour], radii=[-6.0], labels=[text], show_labels=True)
    canvas.style(path, point)


def _draw_truth(canvas: Canvas, run: Run) -> None:
    if run.truth is None:
        return
    known = np.flatnonzero(np.isfinite(run.truth.x) & np.isfinite(run.truth.y))
    xy = np.column_stack([run.truth.x, run.truth.y])[known]
    _draw_path(canvas, ["map", "truth"], TRUTH, run.truth.time_ns[known], xy)


def _draw_track(canvas: Canvas, lane: Lane) -> None:
    """The track of valid estimates, and the 95 % ellipse of each position that claims a covariance."""
    said = [update.estimate for update in lane.final if update.estimate.valid]
    sound = [estimate for estimate in said if all(map(math.isfinite, estimate.pose[:2]))]
    time_ns = np.array([estimate.time_ns for estimate in sound], dtype=np.int64)
    xy = np.array([estimate.pose[:2] for estimate in sound]).reshape(-1, 2)
    place = ["map", "estimate", lane.name]
    _draw_path(canvas, place, colour_of(lane.name), time_ns, xy)
    _draw_ellipses(canvas, [*place, "covariance"], colour_of(lane.name), thinned(sound))


Rows = TypeVar("Rows", list[Estimate], NDArray[np.int64], NDArray[np.float64])


def thinned(rows: Rows) -> Rows:
    """Every n-th of ``rows``, at most `MOST_POSES` of them."""
    return rows[:: max(math.ceil(len(rows) / MOST_POSES), 1)]


def _draw_path(
    canvas: Canvas, place: Sequence[str], colour: Colour, time_ns: NDArray[np.int64], xy: NDArray[np.float64]
) -> None:
    """The whole path, faint; where it was lately (the layout says how long), strong; and where it is."""
    rr = canvas.rr
    time_ns, xy = thinned(time_ns), thinned(xy)
    if len(xy) == 0:
        return
    faint = {"colors": [(*colour, FAINT)], "radii": [-1.0], "draw_order": -5}
    path = rr.Points2D(xy, **faint) if mostly_jumps(time_ns, xy) else rr.LineStrips2D([xy], **faint)
    canvas.style([*place, "path"], path)
    for part, radius in (("trail", -2.0), ("pose", -6.0)):
        canvas.style([*place, part], rr.Points2D.from_fields(colors=[(*colour, STRONG)], radii=[radius]))
        canvas.columns([*place, part], time_ns, rr.Points2D.columns(positions=xy))


def mostly_jumps(time_ns: NDArray[np.int64], xy: NDArray[np.float64]) -> bool:
    """Whether most of a path's length is jumps, as of a method without memory: lines there would hide the map."""
    steps_m, steps_s = np.hypot(*np.diff(xy, axis=0).T), np.diff(time_ns) / NANOSECONDS
    return bool(steps_m[steps_m > JUMP_M_S * steps_s].sum() > 0.5 * steps_m.sum())


def _draw_ellipses(canvas: Canvas, place: Sequence[str], colour: Colour, estimates: Sequence[Estimate]) -> None:
    """Half axes are the roots of the covariance's eigenvalues times the chi-square value of two degrees."""
    both = [(e, e.covariance) for e in estimates if e.covariance is not None and all(map(math.isfinite, e.covariance))]
    if not both:
        return
    claimed = [estimate for estimate, _ in both]
    eigenvalues, axes = np.linalg.eigh(np.array([[[c.xx, c.xy], [c.xy, c.yy]] for _, c in both]))
    half_sizes = np.sqrt(np.maximum(eigenvalues, 0.0) * CHI_SQUARE_95[2])
    half_angle = 0.5 * np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    none = np.zeros_like(half_angle)
    quaternion_xyzw = np.column_stack([none, none, np.sin(half_angle), np.cos(half_angle)])
    centre = np.array([(*e.pose[:2], 0.0) for e in claimed])
    rr, time_ns = canvas.rr, [e.time_ns for e in claimed]
    canvas.style(place, rr.Ellipses2D.from_fields(colors=[(*colour, STRONG)], line_radii=[-1.0]))
    canvas.columns(
        place,
        time_ns,
        rr.Transform3D.columns(translation=centre, quaternion=quaternion_xyzw),
        rr.Ellipses2D.columns(half_sizes=half_sizes),
    )


def _draw_readings(canvas: Canvas, run: Run) -> None:
    """Signal strengths [dBm] and ranges [m] as they came, one series per anchor."""
    series: dict[tuple[str, str], list[tuple[int, float]]] = {}
    for measurement in run.measurements:
        if isinstance(measurement, WifiScan):
            for rssi in measurement.readings:
                row = (measurement.time_ns - rssi.age_ns, rssi.rssi_dbm)
                series.setdefault(("rssi", rssi.anchor), []).append(row)
        elif isinstance(measurement, Ranges):
            for distance in measurement.readings:
                series.setdefault(("ranges", distance.anchor), []).append((measurement.time_ns, distance.range_m))
    for (kind, anchor), rows in sorted(series.items()):
        canvas.plot([kind, anchor], anchor, anchor_colour(run.world, anchor), sorted(rows))


def anchor_colour(world: World, anchor: str) -> Colour:
    """The colour of an anchor in plots; grey for what is no anchor of the world."""
    known = [item.id for item in world.anchors]
    return PALETTE[known.index(anchor) % len(PALETTE)] if anchor in known else GREY


def _draw_errors(canvas: Canvas, run: Run, score: Score, *, shown: bool) -> None:
    """Position error [m] and heading error [deg] at the instants the bench judges."""
    if run.truth is None or score.errors is None:
        return
    time_ns = evaluation_instants(run.truth).time_ns.tolist()
    name, colour = score.estimator, colour_of(score.estimator)
    canvas.line(["error", name], name, colour, zip(time_ns, score.errors.position.tolist(), strict=True), shown=shown)
    degrees = np.degrees(score.errors.heading).tolist()
    canvas.line(["heading_error", name], name, colour, zip(time_ns, degrees, strict=True), shown=shown)


def _draw_fates(canvas: Canvas, frame: Frame, world: World, lane: Lane) -> None:
    """Weight and NIS of every reading, one series per anchor; a reading without anchor goes by its sensor."""
    by_anchor: dict[str, list[Fate]] = {}
    for fate in (fate for update in lane.final for fate in update.fates):
        by_anchor.setdefault(fate.anchor or fate.sensor, []).append(fate)
    for anchor, fates in sorted(by_anchor.items()):
        colour = anchor_colour(world, anchor)
        weights = [(fate.time_ns, fate.weight) for fate in fates]
        canvas.plot(["weight", lane.name, anchor], anchor, colour, weights)
        nis = [(fate.time_ns, fate.nis) for fate in fates if fate.nis is not None]
        canvas.plot(["nis", lane.name, anchor], anchor, colour, nis)
    if any(fate.nis is not None for fates in by_anchor.values() for fate in fates):
        limit = [(frame.start_ns, NIS_LIMIT), (frame.end_ns, NIS_LIMIT)]
        canvas.line(["nis", lane.name, "95 % limit"], "95 % limit", TRUTH, limit)


def markdown(scores: Sequence[Score]) -> str:
    """The score table, the best first, and why an estimator is missing from it."""
    titles = ["estimator", *(column.title.replace("\n", " ") for column in COLUMNS)]
    lines = ["| " + " | ".join(titles) + " |", "|---" * len(titles) + "|"]
    for score in ranked(scores):
        values = {**score.facts, **score.metrics}
        remark = "" if score.status in ("ok", "unscored") else f" ({score.status})"
        cells = [score.estimator + remark, *(as_text(column, values) for column in COLUMNS)]
        lines.append("| " + " | ".join(cells) + " |")
    crashes = [f"\n{score.estimator} crashed: {score.error}" for score in scores if score.error is not None]
    return "\n".join([*lines, *crashes]) + "\n"
