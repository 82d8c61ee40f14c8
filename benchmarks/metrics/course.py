"""The true course: where the robot was when estimators are judged, and what follows from that alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.track import Flags, Floats, Points, Whole, points
from fusion.values import nanoseconds

DISTANCES_M = (1, 5, 10)
DURATIONS_S = (1, 5, 10)
LONGEST = 1.5
"""A pair whose ends lie further apart than this many times what was asked, as across a gap, is none."""
ROUNDING_M = 1e-9
"""A path is that much longer than its sum of floating-point steps says: whole steps then end where they should."""
APART = 1e6
"""Between two runs lies that much path [m] and time [s]: no pair reaches over."""

Pairs = tuple[slice | Whole, slice | Whole]
"""Indices of the instants where each pair starts and ends."""


@dataclass(frozen=True, eq=False)
class Instants:
    """The true poses to be met: all (n,); [m], [rad], map frame; heading NaN where it is not known.

    Several runs may stand one after the other; ``starts`` are the indices where they start. What follows from the
    truth is found when first asked for, once for all estimators that are judged by it.
    """

    time_ns: Whole
    x: Floats
    y: Floats
    heading: Floats
    starts: tuple[int, ...] = (0,)

    def __len__(self) -> int:
        return len(self.time_ns)

    @classmethod
    def together(cls, parts: Sequence[Instants]) -> Instants:
        """All of all parts."""
        starts, count = [], 0
        for part in parts:
            starts += [count + start for start in part.starts if len(part)]
            count += len(part)
        columns = [(part.time_ns, part.x, part.y, part.heading) for part in parts]
        time_ns, x, y, heading = (np.concatenate(column) for column in zip(*columns, strict=True))
        return cls(time_ns, x, y, heading, tuple(starts) or (0,))

    def at(self, rows: Whole | Flags) -> Instants:
        """Some of them, by index or mask, as one run."""
        return Instants(self.time_ns[rows], self.x[rows], self.y[rows], self.heading[rows])

    def end_of_run(self, row: int) -> int:
        """The index behind the last instant of the run that ``row`` belongs to."""
        return next((start for start in self.starts if start > row), len(self))

    @cached_property
    def run(self) -> Whole:
        """The number of each one's run, (n,)."""
        return np.repeat(np.arange(len(self.starts)), np.diff([*self.starts, len(self)]))

    @cached_property
    def joined(self) -> Flags:
        """Whether an instant and the next one belong to one run, (n - 1,)."""
        return np.asarray(self.run[1:] == self.run[:-1])

    @cached_property
    def points(self) -> Points:
        """Positions [m]."""
        return points(self.x, self.y)

    @cached_property
    def facing(self) -> Points:
        """Unit vectors of the headings; NaN where they are not known."""
        return points(np.cos(self.heading), np.sin(self.heading))

    @cached_property
    def step_m(self) -> Floats:
        """From each position to the next, (n - 1,)."""
        return np.abs(self.points[1:] - self.points[:-1])

    @cached_property
    def clock_ns(self) -> Whole:
        """Time since the first of all."""
        return _added_up(self.time_ns[1:] - self.time_ns[:-1], self.joined, nanoseconds(APART))

    @cached_property
    def pairs(self) -> dict[str, Pairs]:
        """From every instant to the first one after at least 1, 5, 10 m of path, ``d_1m`` and so on, or 1, 5, 10 s."""
        path_m, steps_ns = _added_up(self.step_m, self.joined, APART), self.clock_ns[1:] - self.clock_ns[:-1]
        period_ns = int(steps_ns[0]) if len(steps_ns) and steps_ns.min() == steps_ns.max() else 0
        by_distance = {f"d_{reach}m": ahead(path_m, reach - ROUNDING_M) for reach in DISTANCES_M}
        by_time = {f"t_{reach}s": later(self.clock_ns, nanoseconds(reach), period_ns) for reach in DURATIONS_S}
        return {**by_distance, **by_time}


def _added_up(steps: Whole | Floats, joined: Flags, apart: float) -> NDArray[Any]:
    """Their sums from the first instant on (n,), ``apart`` in place of a step (n - 1,) from one run to another."""
    sums = np.zeros(len(steps) + 1, dtype=steps.dtype)
    np.cumsum(np.where(joined, steps, apart), out=sums[1:])
    return sums


def ahead(along: Floats | Whole, reach: float) -> Pairs:
    """Each index and the first one whose ``along`` (n,), which never falls, is at least ``reach`` more."""
    end = np.searchsorted(along, along + reach)
    count = int(np.searchsorted(end, len(along)))
    end = end[:count]
    near = along[end] - along[:count] <= LONGEST * reach
    return (slice(count), end) if near.all() else (np.flatnonzero(near), end[near])


def later(clock_ns: Whole, reach_ns: int, period_ns: int) -> Pairs:
    """`ahead` of times: where they come every ``period_ns``, the pairs are plain slices and cost nothing."""
    if not 0 < period_ns <= (LONGEST - 1.0) * reach_ns:
        return ahead(clock_ns, reach_ns)
    count = -(-reach_ns // period_ns)
    return slice(max(len(clock_ns) - count, 0)), slice(count, None)
