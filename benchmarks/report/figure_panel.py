"""One picture of a report, whose points lead to cells, and where they are moments to these."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion.arrays import Floats
from fusion.output.figures import as_png, label, panels, plain_ticks
from fusion.output.html import inline_png

FINE = 1e4
"""Parts of the width and the height of a picture, in which places are counted."""

LEFT_INCHES, RIGHT_INCHES, BOTTOM_INCHES, TOP_INCHES = 0.75, 0.2, 0.55, 0.3
ROW_INCHES, LINE_INCHES = 0.45, 0.17
LONG_NAME = 26
"""Letters of which two fit side by side into a legend no more."""

DIGITS = ((0.6, (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)), (2.0, (1.0, 2.0, 5.0)), (np.inf, (1.0,)))
"""Digits of the ticks for so many decades along x: as many as have room side by side."""

POINTING = """
function pointAt(figure, targets) {
  const hint = figure.appendChild(document.createElement("small"));
  const ring = figure.appendChild(document.createElement("i"));
  const nearest = (event) => {
    const box = figure.firstElementChild.getBoundingClientRect();
    let best = { away: 24 };
    for (const [cell, caption, xs, ys, times] of targets) {
      for (let k = 0; k < xs.length; k++) {
        const x = box.width * xs[k] / 1e4, y = box.height * ys[k] / 1e4;
        const away = Math.hypot(box.left + x - event.clientX, box.top + y - event.clientY);
        if (away < best.away) best = { away, x, y, cell, caption, at: times && times[k].toFixed(2) };
      }
    }
    return best;
  };
  const show = ({ x, y, caption, at }) => {
    ring.style.cssText = caption ? `left: ${x}px; top: ${y}px` : "display: none";
    hint.textContent = caption ? caption + (at ? `, at ${at} s` : "") : "";
    figure.style.cursor = caption ? "pointer" : "";
  };
  show({});
  figure.onpointermove = (event) => show(nearest(event));
  figure.onpointerleave = () => show({});
  figure.firstElementChild.onclick = (event) => {
    const target = nearest(event);
    show(target);
    if (!target.cell) return;
    if (target.at) showMoment(document.getElementById(target.cell), target.at);
    if (location.hash === "#" + target.cell) reveal();
    location.hash = target.cell;
  };
}
function showMoment(entry, at) {
  const command = entry.querySelector("code");
  let moment = entry.querySelector(".moment");
  if (!moment) {
    moment = entry.appendChild(document.createElement("div"));
    moment.className = "moment";
    moment.append(document.createElement("span"), document.createElement("code"));
    offerCopy(moment.lastChild);
  }
  moment.firstChild.textContent = `what was clicked, at ${at} s: `;
  moment.lastChild.textContent = command.textContent.replace(/--at [0-9.]+/, `--at ${at}`);
}
for (const figure of document.querySelectorAll("[data-targets]")) pointAt(figure, JSON.parse(figure.dataset.targets));
"""
"""The target nearest to the pointer is ringed, named below the picture, and opened by a click. It needs `reveal` and
`offerCopy` of the page's own script. Without it, or without a pointer, the tables lead to the same cells.
"""


def height_of(rows: int) -> float:
    """Of a panel with rows, in inches."""
    return 1.0 + ROW_INCHES * max(rows, 2)


def without_targets(text: str) -> str:
    """A report whose pictures lead nowhere, for a page without `POINTING`."""
    return re.sub(r' data-targets="[^"]*"', "", text)


class Target(NamedTuple):
    """Points at ``x``, ``y`` in the units of the axes that lead to ``anchor``; ``at_s``: where each point is a moment,
    since the start of the run.
    """

    x: Floats
    y: Floats
    anchor: str
    caption: str
    at_s: Floats | None


class Panel:
    """Axes with a title, of a height in inches, whose points lead to the anchors given to `lead`. ``fits``: whether all
    that stands around the axes is their own labels, so that nobody has to measure it: that takes half of the time.
    """

    def __init__(self, title: str, x: str, y: str, height: float = 3.4, *, fits: bool = True) -> None:
        self.title = title
        self.figure, (self.axes,) = panels(1, height)
        self._targets: list[Target] = []
        label(self.axes, title, x, y)
        if fits:
            self.figure.set_layout_engine(None)
            self._leave_room(0.0)

    def _leave_room(self, below: float) -> None:
        """For the labels, and so many inches ``below`` them."""
        width, height = self.figure.get_size_inches()
        left = LEFT_INCHES if self.axes.get_ylabel() else RIGHT_INCHES
        ends = {"left": left / width, "right": 1.0 - RIGHT_INCHES / width}
        self.figure.subplots_adjust(**ends, bottom=(BOTTOM_INCHES + below) / height, top=1.0 - TOP_INCHES / height)

    def lead(self, x: Floats | float, y: Floats | float, anchor: str, caption: str, at_s: Floats | None = None) -> None:
        """Let points lead to an entry of the page; one point may be two numbers."""
        across, up = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(y))
        self._targets.append(Target(across.astype(np.float64), up.astype(np.float64), anchor, caption, at_s))

    def log(self, which: Literal["x", "y"]) -> None:
        """A logarithmic axis, where anything is on it: where every estimator was lost, nothing is."""
        axes = self.axes
        axis, (_, most), least, room = {
            "x": (axes.xaxis, axes.dataLim.intervalx, axes.dataLim.minposx, 1.0),
            "y": (axes.yaxis, axes.dataLim.intervaly, axes.dataLim.minposy, 1.75),
        }[which]
        if np.isfinite(least):
            axes.set(**{f"{which}scale": "log"})
            decades = np.log10(most / least) / room
            plain_ticks(axis, next(digits for upto, digits in DIGITS if decades <= upto))

    def rows(self, names: Sequence[str]) -> None:
        """A row for each name, the first on top. It stands above its row, for beside it a long one leaves no room: what
        is drawn of row k belongs to k ± 0.3.
        """
        self.axes.set_ylim(len(names) - 0.5, -0.8)
        self.axes.set_yticks(range(len(names)), [""] * len(names))
        for row, name in enumerate(names):
            self.axes.annotate(
                name,
                (0.0, row - 0.35),
                (2, 0),
                xycoords=self.axes.get_yaxis_transform(),
                textcoords="offset points",
                fontsize=8,
                verticalalignment="bottom",
                bbox={"color": "white", "alpha": 0.7, "pad": 0.0},
            )

    def legend(self) -> None:
        """Below the axes, which keep their size."""
        handles, names = self.axes.get_legend_handles_labels()
        columns = 1 if max(map(len, names), default=0) > LONG_NAME else 2
        below = LINE_INCHES * -(-len(names) // columns)
        self.figure.set_figheight(self.figure.get_figheight() + below)
        self._leave_room(below)
        self.figure.legend(
            handles, names, loc="lower center", ncols=columns, frameon=False, fontsize=8, borderaxespad=0.1
        )

    def block(self) -> str:
        """The picture as a line of HTML, with its targets."""
        image = f'<img alt="{html.escape(self.title)}" src="{inline_png(as_png(self.figure))}">'
        # Only now that all is drawn is known where.
        visible = [shown for target in self._targets if (shown := self._shown(target))]
        targets = html.escape(json.dumps(visible, separators=(",", ":")))
        return f'<div class="figure" data-targets="{targets}">{image}</div>'

    def _shown(self, target: Target) -> Sequence[object] | None:
        """Anchor, words, places from the left and from the top, times; None where nothing of it is in the picture."""
        places = self.axes.transData.transform(np.column_stack(target[:2])) / self.figure.bbox.size
        with np.errstate(invalid="ignore"):
            inside = np.all((places >= 0.0) & (places <= 1.0), axis=1)
        if not inside.any():
            return None
        across, up = np.round(FINE * places[inside]).astype(int).T
        times = [] if target.at_s is None else [np.round(target.at_s[inside], 2).tolist()]
        return [target.anchor, target.caption, across.tolist(), (int(FINE) - up).tolist(), *times]


def group(every: Iterable[Panel]) -> str:
    """Panels side by side, as many as there is room for: a line of HTML."""
    return f'<div class="figures">{"".join(panel.block() for panel in every)}</div>'


def peaks(values: Floats, most: int) -> NDArray[np.intp]:
    """Indices of the greatest value of each of at most ``most`` stretches: thinned so, a curve keeps its peaks.

    >>> peaks(np.array([1.0, 5.0, 2.0, np.nan, 0.0]), 3)
    array([1, 2, 4])
    """
    step = max(-(-len(values) // most), 1)
    known = np.where(np.isnan(values), -np.inf, values)
    stretches = np.pad(known, (0, -len(values) % step), constant_values=-np.inf).reshape(-1, step)
    places: NDArray[np.intp] = step * np.arange(len(stretches)) + stretches.argmax(axis=1)
    return places
