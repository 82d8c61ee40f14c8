"""Messages and readings of a run as columns, and how a fault finds its own among them: by topic, source and time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fusion import Gyro, MotorCommand, Odometry, ParameterError, Ranges, WheelTicks, WifiScan
from fusion.arrays import Flags, Floats
from fusion.errors import nearest

Windows = tuple[tuple[float, float], ...]
"""Stretches of time [s] from the run's start; the beginning belongs to one, the end does not."""

TOPICS: dict[type, str] = {
    WheelTicks: "odom",
    Odometry: "odom",
    MotorCommand: "command",
    Gyro: "gyro",
    WifiScan: "wifi",
    Ranges: "ranges",
}
"""Topic of the measurements of each type in a suite: wheels are one topic, as counts or as increments."""


@dataclass(frozen=True, slots=True)
class RowSelection:
    """Columns (n,) of messages, or of single readings. ``source``: the sensor of a message, the anchor of a reading."""

    topic: NDArray[np.str_]
    source: NDArray[np.str_]
    elapsed_s: Floats
    """Stamp, by its own clock, from the run's start."""
    kept: Flags
    """False: lost; the one column that is written into."""

    def sources(self, topic: str) -> list[str]:
        """Sensors or anchors on ``topic``, sorted."""
        return sorted(map(str, np.unique(self.source[self.topic == topic])))

    def within(self, windows: Windows | None) -> Flags:
        """Rows stamped in one of ``windows``; None is always."""
        if windows is None:
            return np.ones(len(self.kept), dtype=bool)
        inside = np.zeros(len(self.kept), dtype=bool)
        for begin, end in windows:
            inside |= (begin <= self.elapsed_s) & (self.elapsed_s < end)
        return inside

    def select(self, topic: str, source: str = "", windows: Windows | None = None) -> Flags:
        """Rows on ``topic``, from ``source`` ("": from all), in ``windows``; raises `ParameterError` for one that the
        run does not have.
        """
        if topic not in self.topic:
            raise ParameterError(f"the run has no topic {topic!r}; {it_has(topic, sorted(set(map(str, self.topic))))}")
        if source and source not in self.sources(topic):
            raise ParameterError(f"the run has no {source!r} on {topic}; {it_has(source, self.sources(topic))}")
        chosen = (self.topic == topic) & self.within(windows)
        return np.asarray(chosen & (self.source == source)) if source else chosen

    def draw(self, topic: str, sample: Callable[[int], Floats]) -> Floats:
        """One vector of random numbers for all rows on ``topic``, in their order; zero elsewhere."""
        drawn, rows = np.zeros(len(self.kept)), self.topic == topic
        drawn[rows] = sample(int(rows.sum()))
        return drawn


def it_has(name: str, known: Sequence[str]) -> str:
    """The end of a message about a ``name`` that a run does not have: those it has, and which was probably meant."""
    near = nearest(name, known)
    return f"it has {', '.join(known) or 'no measurements at all'}" + (f"; did you mean {near!r}?" if near else "")
