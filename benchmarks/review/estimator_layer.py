"""One estimator on the map: its path, where it is and how sure, how far off, and which readings put it there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.fates import Codes, fates_of
from benchmarks.metrics.score import CHI_SQUARE_95
from benchmarks.review.canvas import STRONG, Canvas, Place, draw_path, thinned
from benchmarks.review.drawing import Drawing
from benchmarks.review.radio_circles import ReadingColumns
from fusion import Reason, World
from fusion.arrays import Flags, Floats, Stamps, Whole
from fusion.output.colours import ANCHOR, REFUSED
from fusion.values import nanoseconds

CIRCLE_OPACITY = 130
CIRCLE_S = 1.0
"""Time for which a reading is shown: readings this close together count as one view of the anchors."""
PARTICLE_OPACITY, PARTICLE_PIXELS = (70, 200), (0.75, 2.25)
"""Opacity and radius of a particle without weight, and of the heaviest one of its cloud."""
COUNTERFACTUAL_THICKNESS = 0.5
"""Of the lines of what would have been, against those of what was."""


def thickness(drawing: Drawing) -> float:
    """Thickness of an estimator's lines."""
    return COUNTERFACTUAL_THICKNESS if drawing.is_counterfactual else 1.0


def draw_on_map(
    canvas: Canvas, world: World, readings: ReadingColumns, drawing: Drawing, legend: tuple[float, float]
) -> None:
    """The estimator's part of the map; ``legend``: its place in the legend."""
    place = ["map", "estimate", drawing.name]
    text = drawing.name if drawing.shown else f"{drawing.name} (hidden)"
    canvas.label(["map", "legend", drawing.name], text, drawing.colour, legend, radius=-6.0 * thickness(drawing))
    draw_path(canvas, place, drawing.colour, *drawing.track[:2], thickness=thickness(drawing))
    _draw_error_line(canvas, [*place, "error"], drawing)
    if not drawing.is_counterfactual:
        _draw_ellipses(canvas, [*place, "covariance"], drawing)
        _draw_circles(canvas, [*place, "readings"], world, readings, drawing)
        _draw_particles(canvas, [*place, "particles"], drawing)


def _draw_ellipses(canvas: Canvas, place: Place, drawing: Drawing) -> None:
    """The 95 % region of each position that claims a covariance: its half axes are the roots of the covariance's
    eigenvalues times the chi-square value of two degrees.
    """
    claimed = np.isfinite(drawing.track.covariance).all(axis=1)
    if not claimed.any():
        return
    track = drawing.track
    time_ns, xy, covariance = track.time_ns[claimed], track.xy[claimed], track.covariance[claimed]
    eigenvalues, axes = np.linalg.eigh(covariance[:, [0, 1, 1, 3]].reshape(-1, 2, 2))
    half_angle = 0.5 * np.arctan2(axes[:, 1, 0], axes[:, 0, 0])
    none = np.zeros_like(half_angle)
    quaternion_xyzw = np.column_stack([none, none, np.sin(half_angle), np.cos(half_angle)])
    rr, half_sizes = canvas.rr, np.sqrt(np.maximum(eigenvalues, 0.0) * CHI_SQUARE_95[2])
    canvas.style(place, rr.Ellipses2D.from_fields(colors=[(*drawing.colour, STRONG)], line_radii=[-1.0]))
    canvas.columns(
        place,
        time_ns,
        rr.Transform3D.columns(translation=np.column_stack([xy, none]), quaternion=quaternion_xyzw),
        rr.Ellipses2D.columns(half_sizes=half_sizes),
    )


def _draw_error_line(canvas: Canvas, place: Place, drawing: Drawing) -> None:
    """From the estimate to the truth at that time; no line while there is no valid answer."""
    if drawing.instants is None or drawing.answers is None:
        return
    chosen = thinned(np.arange(len(drawing.instants.time_ns)))
    valid = drawing.answers.valid[chosen]
    if not valid.any():
        return
    answer, truth = (np.column_stack([at.x, at.y])[chosen][valid] for at in (drawing.answers, drawing.instants))
    strips = np.stack([answer, truth], axis=1)
    look = {"colors": [(*drawing.colour, STRONG)], "radii": [-0.75 * thickness(drawing)]}
    canvas.style(place, canvas.rr.LineStrips2D.from_fields(**look))
    rows = canvas.rr.LineStrips2D.columns(strips=strips).partition(valid.astype(np.int64))
    canvas.columns(place, drawing.instants.time_ns[chosen], rows)


def _draw_circles(canvas: Canvas, place: Place, world: World, readings: ReadingColumns, drawing: Drawing) -> None:
    """The circle around each anchor on which its newest reading puts the robot: in the anchor's yellow when the
    estimator gave it full weight, vermillion when none.
    """
    fates, rr = drawing.fates, canvas.rr
    radius_m = readings.radii(fates_of(drawing.final))
    asked = np.flatnonzero(~fates.met(Reason.KIND_NOT_CONSUMED))
    if not np.isfinite(radius_m[asked]).any():
        return
    end_ns = int(drawing.estimates.time_ns[-1])
    time_ns, rows, lengths = newest(fates.time_ns[asked], fates.anchor[asked], np.isfinite(radius_m[asked]), end_ns)
    drawn = asked[rows]
    position = {anchor.id: (anchor.x, anchor.y) for anchor in world.anchors}
    centers = np.array([position.get(name, (np.nan, np.nan)) for name in fates.names.tolist()])
    circles = {
        "centers": centers[fates.anchor[drawn]],
        "half_sizes": np.repeat(radius_m[drawn, None], 2, axis=1),
        "colors": weight_colours(fates.weight[drawn]),
    }
    canvas.style(place, rr.Ellipses2D.from_fields(line_radii=[-0.75]))
    canvas.columns(place, time_ns, rr.Ellipses2D.columns(**circles).partition(lengths))


def newest(time_ns: Stamps, anchor: Codes, drawn: Flags, end_ns: int) -> tuple[Stamps, Whole, Whole]:
    """Readings (n,) in time order as rows of a table: the time from which each row is shown [ns] (m,), up to
    ``end_ns``, the readings shown then, row after row, and the number of each row (m,).

    Of each anchor the newest, for `CIRCLE_S`: many devices send one range a message. Those not ``drawn`` are not shown,
    and hide the anchor's reading before.
    """
    edges_ns = np.unique(np.concatenate([time_ns, time_ns + nanoseconds(CIRCLE_S)]))
    edges_ns = edges_ns[edges_ns <= end_ns]
    codes = np.unique(anchor)
    seen = np.full((len(edges_ns), len(codes)), -1, dtype=np.int64)
    for column, code in zip(seen.T, codes.tolist(), strict=True):
        own = np.flatnonzero(anchor == code)
        last = np.searchsorted(time_ns[own], edges_ns, side="right") - 1
        young = (last >= 0) & (edges_ns - time_ns[own[last]] < nanoseconds(CIRCLE_S)) & drawn[own[last]]
        column[young] = own[last[young]]
    changed = np.append(True, (np.diff(seen, axis=0) != 0).any(axis=1))
    seen = seen[changed]
    return edges_ns[changed], seen[seen >= 0], (seen >= 0).sum(axis=1)


def _draw_particles(canvas: Canvas, place: Place, drawing: Drawing) -> None:
    """The clouds, the larger and the stronger the heavier a particle is among those of its cloud."""
    clouds, rr = drawing.reviewed.clouds, canvas.rr
    if clouds is None:
        return
    starts = np.concatenate([[0], np.cumsum(clouds.lengths)[:-1]])
    share = clouds.weights / np.repeat(np.maximum.reduceat(clouds.weights, starts), clouds.lengths)
    opacity = np.interp(share, (0.0, 1.0), PARTICLE_OPACITY).round().astype(np.uint32)
    red, green, blue = drawing.colour
    columns = {
        "positions": clouds.positions,
        "radii": -np.interp(np.sqrt(share), (0.0, 1.0), PARTICLE_PIXELS),
        "colors": opacity + ((red << 24) + (green << 16) + (blue << 8)),
    }
    canvas.style(place, rr.Points2D.from_fields(draw_order=-10.0))
    canvas.columns(place, clouds.cloud_ns, rr.Points2D.columns(**columns).partition(clouds.lengths))


def weight_colours(weights: Floats) -> NDArray[np.uint8]:
    """RGBA (n, 4) between vermillion (weight 0) and the yellow of anchors (weight 1)."""
    share = np.clip(weights, 0.0, 1.0)[:, None]
    rgb = (1.0 - share) * np.array(REFUSED) + share * np.array(ANCHOR)
    return np.column_stack([rgb, np.full(len(weights), CIRCLE_OPACITY)]).round().astype(np.uint8)
