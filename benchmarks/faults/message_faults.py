"""Faults of the way a message takes: lost, late, or stamped by a clock that is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from benchmarks.faults.fault import Fault
from benchmarks.faults.row_selection import TOPICS, Windows
from benchmarks.faults.run_columns import RunColumns
from fusion import ParameterError
from fusion.arrays import Flags, Floats
from fusion.values import NANOSECONDS

ALL_TOPICS = tuple(sorted(set(TOPICS.values())))


@dataclass(frozen=True, slots=True)
class Drop(Fault):
    """Messages of a topic vanish, or the readings of one anchor; a scan without readings vanishes too.

    Each with probability ``p``, in ``windows`` or always. In bursts with ``p_enter`` and ``p_exit``: only while the
    channel is bad, which it becomes and ceases to be with these probabilities from one message to the next, good at
    first (Gilbert 1960). A bad stretch lasts 1 / p_exit messages on average.
    """

    kind: ClassVar[str] = "drop"
    topics: ClassVar[tuple[str, ...]] = ALL_TOPICS
    topic: str
    source: str = ""
    windows: Windows | None = None
    p: float = 1.0
    p_enter: float | None = None
    p_exit: float | None = None

    def __post_init__(self) -> None:
        Fault.__post_init__(self)  # dataclasses with slots are made twice, so super() finds the wrong one
        if (self.p_enter is None) != (self.p_exit is None):
            raise ParameterError("p_enter and p_exit: give both for losses in bursts, or neither")

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """Two draws a row: whether it is lost, and whether the channel changes."""
        rows = columns.rows(self.topic, self.source)
        named = rows.select(self.topic, self.source)
        lost = named & rows.within(self.windows) & (rows.draw(self.topic, random.random) < self.p)
        change = rows.draw(self.topic, random.random)
        if self.p_enter is not None and self.p_exit is not None:
            lost[named] &= _bad(change[named], self.p_enter, self.p_exit)
        rows.kept[lost] = False


def _bad(change: Floats, p_enter: float, p_exit: float) -> Flags:
    """True where the channel is bad, at each of (n,) uniform draws in a row."""

    def states() -> Iterator[bool]:
        bad = False
        for draw in change:
            bad = draw >= p_exit if bad else draw < p_enter
            yield bool(bad)

    return np.fromiter(states(), dtype=bool, count=len(change))


@dataclass(frozen=True, slots=True)
class Delay(Fault):
    """Messages arrive late and keep their stamp: ``mean_s``, with a Gaussian ``jitter_s`` but never early. Messages
    may overtake one another.
    """

    kind: ClassVar[str] = "delay"
    topics: ClassVar[tuple[str, ...]] = ALL_TOPICS
    topic: str
    mean_s: float
    jitter_s: float = 0.0
    source: str = ""
    windows: Windows | None = None

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """One draw a message."""
        late = columns.messages.select(self.topic, self.source, self.windows)
        jitter_s = self.jitter_s * columns.messages.draw(self.topic, random.standard_normal)
        delay_s = np.maximum(0.0, self.mean_s + jitter_s[late])
        columns.arrival_ns[late] += np.rint(delay_s * NANOSECONDS).astype(np.int64)


@dataclass(frozen=True, slots=True)
class Clock(Fault):
    """The clock of one device, or of a whole topic, is ahead by ``offset_s`` at the run's start and gains ``drift_ppm``
    millionths of a second a second. Messages arrive when they did.
    """

    kind: ClassVar[str] = "clock"
    topics: ClassVar[tuple[str, ...]] = ALL_TOPICS
    topic: str
    source: str = ""
    offset_s: float = 0.0
    drift_ppm: float = 0.0

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:  # noqa: ARG002 - no chance in it
        """Shift the stamps, and where increments begin, so that they still meet."""
        device = columns.messages.select(self.topic, self.source)
        for column in (columns.stamp_ns, columns.from_ns):
            ahead_ns = self.offset_s * NANOSECONDS + self.drift_ppm * 1e-6 * (column[device] - columns.start_ns)
            column[device] += np.rint(ahead_ns).astype(np.int64)


@dataclass(frozen=True, slots=True)
class GyroDrop(Fault):
    """Messages of the gyro vanish, in ``windows`` or always."""

    kind: ClassVar[str] = "gyro_drop"
    windows: Windows | None = None

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """As `Drop` does."""
        Drop("gyro", windows=self.windows).apply(columns, random)
