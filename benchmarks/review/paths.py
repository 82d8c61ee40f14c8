"""A path on the map: all of it faint, where it was lately strong, and where it is."""

from __future__ import annotations

import numpy as np

from benchmarks.colours import Colour
from benchmarks.metrics.track import Floats, Stamps
from benchmarks.review.canvas import FAINT, STRONG, Canvas, Place, thinned
from fusion.values import NANOSECONDS

JUMP_M_S = 5.0
"""No indoor robot is this fast: a track that is, jumps."""


def draw_path(
    canvas: Canvas, place: Place, colour: Colour, time_ns: Stamps, xy: Floats, *, thickness: float = 1.0
) -> None:
    """Positions ``xy`` (n, 2) [m]; how far back the strong part goes is the layout's to say."""
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
    """Whether most of a path's length is jumps, as of a method without memory: lines there would hide the map."""
    steps_m, steps_s = np.hypot(*np.diff(xy, axis=0).T), np.diff(time_ns) / NANOSECONDS
    return bool(steps_m[steps_m > JUMP_M_S * steps_s].sum() > 0.5 * steps_m.sum())
