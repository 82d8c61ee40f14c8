"""The part of the map and of time that a review shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusion.values import NANOSECONDS, seconds
from logs.prior import begin_ns
from logs.run import Run

TIMELINE = "t"
"""Time since the run's start."""
UTC = "utc"
"""The same as date and time of day, where the stamps are Unix time."""
UNIX_SINCE_NS = 1_000_000_000 * NANOSECONDS
"""Stamps from here on, September 2001, count from 1970: no clock that counts from its own start has run so long."""
MARGIN = 0.06
"""Free space around the floor, as a share of its width."""
LEGEND = 0.24
"""Room for the legend to the right of the floor, as a share of its width."""


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
        """The floor with all anchors and the true path, from the start of the run to its last message or true pose."""
        bounds, anchors = run.world.bounds, run.world.anchors
        xs = [bounds.x_min, bounds.x_max, *(anchor.x for anchor in anchors)]
        ys = [bounds.y_min, bounds.y_max, *(anchor.y for anchor in anchors)]
        start_ns = begin_ns(run.measurements)
        stamps = [start_ns, *(measurement.time_ns for measurement in run.measurements)]
        if run.truth is not None:
            known = np.isfinite(run.truth.x) & np.isfinite(run.truth.y)
            xs += run.truth.x[known].tolist()
            ys += run.truth.y[known].tolist()
            stamps += run.truth.time_ns[known].tolist()
        return cls(min(xs), max(xs), min(ys), max(ys), start_ns, max(stamps))

    @property
    def timelines(self) -> tuple[str, ...]:
        """The time since the start, and UTC where the stamps are Unix time."""
        return (TIMELINE, UTC) if self.start_ns >= UNIX_SINCE_NS else (TIMELINE,)

    @property
    def duration_s(self) -> float:
        """Length of the run [s]."""
        return seconds(self.end_ns - self.start_ns)

    def legend(self, count: int) -> list[tuple[float, float]]:
        """Places [m] for that many entries, from the top down."""
        x = self.x_max + 0.6 * LEGEND * (self.x_max - self.x_min)
        step = (self.y_max - self.y_min) / max(count, 8)
        return [(x, self.y_max - (i + 0.5) * step) for i in range(count)]
