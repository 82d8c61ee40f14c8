"""What the devices of a recording said of themselves, as lines of a log: opened, lost, back, complaints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.review.canvas import Canvas
from fusion import Level, Remark
from logs.devices import OPENED, STATUS, as_line
from logs.run import Run

DEVICES = "devices"
LEVELS = {Level.OK: "INFO", Level.WARN: "WARN", Level.ERROR: "ERROR"}


def worth_a_line(run: Run) -> Sequence[Remark]:
    """Remarks that are no routine: what is told each second, or beside each scan, is left out."""
    return [r for r in run.remarks if r.text == OPENED or (r.level is not Level.OK and r.text != STATUS)]


def draw_device_events(canvas: Canvas, remarks: Sequence[Remark]) -> None:
    """A line for each; nothing for a run without."""
    if remarks:
        time_ns = np.array([remark.time_ns for remark in remarks], dtype=np.int64)
        levels = [LEVELS[remark.level] for remark in remarks]
        canvas.text(["events", DEVICES], time_ns, levels, [as_line(remark) for remark in remarks])
