"""Ground truth as columns, and the instants at which estimators are evaluated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from fusion import Truth
from fusion.arrays import Flags, Floats, Points, Stamps, Whole, points
from fusion.values import nanoseconds


@dataclass(frozen=True, slots=True, eq=False)
class TruthTrack:
    """Ground truth as columns of one length n, in time order: time [ns], x, y [m], heading [rad] (NaN: not known)."""

    time_ns: Stamps
    x: Floats
    y: Floats
    heading: Floats

    def __len__(self) -> int:
        return len(self.time_ns)

    def at(self, rows: Flags) -> TruthTrack:
        """Some of it, by mask."""
        return TruthTrack(self.time_ns[rows], self.x[rows], self.y[rows], self.heading[rows])

    @classmethod
    def from_truths(cls, truths: Sequence[Truth]) -> TruthTrack:
        """Columns, read-only, from single truths: those with a position; of two at one time the first counts."""
        ordered = sorted((truth for truth in truths if truth.position_known), key=lambda truth: truth.time_ns)
        unique = [truth for i, truth in enumerate(ordered) if i == 0 or truth.time_ns != ordered[i - 1].time_ns]
        time_ns = np.array([truth.time_ns for truth in unique], dtype=np.int64)
        x, y = np.array([t.x for t in unique], dtype=np.float64), np.array([t.y for t in unique], dtype=np.float64)
        heading = np.array([np.nan if t.known_heading is None else t.heading for t in unique], dtype=np.float64)
        for column in (time_ns, x, y, heading):
            column.flags.writeable = False
        return cls(time_ns, x, y, heading)


RATE_HZ = 10.0
"""Truth this fast or faster is resampled to this rate; slower truth is taken at its own stamps."""


GAP_S = 0.5
"""Across a longer gap the truth is not interpolated."""


KEPT_COURSES = 2
"""Truths whose instants are kept: cells come run by run."""


def wrap_angles(angles: Floats) -> Floats:
    """Angles [rad] brought into [-pi, pi]: `fusion.wrap_angle` for arrays."""
    return np.asarray(angles - math.tau * np.rint(angles / math.tau))


@lru_cache(maxsize=KEPT_COURSES)
def evaluation_instants(truth: TruthTrack, *, hz: float = RATE_HZ, gap_s: float = GAP_S) -> Instants:
    """The truth's own stamps when its median rate is below ``hz``, else its clock resampled uniformly at ``hz``.

    Position is interpolated linearly, heading along the shortest arc, nothing is extrapolated. Resampled instants
    inside a gap longer than ``gap_s`` are left out.
    """
    known = known_truth(truth)
    gaps_ns = np.diff(known.time_ns)
    period_ns = nanoseconds(1.0 / hz)
    if len(gaps_ns) == 0 or np.median(gaps_ns) > period_ns:
        return known
    resampled = np.arange(known.time_ns[0], known.time_ns[-1] + 1, period_ns)
    instants, kept = interpolate_truth(known, resampled, gap_s=gap_s)
    return instants.at(kept)


def known_truth(truth: TruthTrack) -> Instants:
    """The truth in time order, each stamp once, without positions that are not finite."""
    finite = np.flatnonzero(np.isfinite(truth.x) & np.isfinite(truth.y))
    time_ns, first = np.unique(truth.time_ns[finite], return_index=True)
    chosen = finite[first]
    return Instants(time_ns, truth.x[chosen], truth.y[chosen], truth.heading[chosen])


def interpolate_truth(known: Instants, time_ns: Whole, *, gap_s: float) -> tuple[Instants, Flags]:
    """The truth at ``time_ns``, all of it between the first and the last of at least two ``known`` poses; False for
    those inside a gap longer than ``gap_s``.
    """
    left = np.minimum(np.searchsorted(known.time_ns, time_ns, side="right") - 1, len(known.time_ns) - 2)
    span_ns = known.time_ns[left + 1] - known.time_ns[left]
    share = (time_ns - known.time_ns[left]) / span_ns
    turn = wrap_angles(known.heading[left + 1] - known.heading[left])
    between = wrap_angles(known.heading[left] + share * turn)
    # At a stamp of the truth itself the other neighbour, perhaps without a heading, does not count.
    heading = np.select([share == 0.0, share == 1.0], [known.heading[left], known.heading[left + 1]], between)
    resampled = Instants(
        time_ns,
        known.x[left] + share * (known.x[left + 1] - known.x[left]),
        known.y[left] + share * (known.y[left + 1] - known.y[left]),
        heading,
    )
    return resampled, (span_ns <= nanoseconds(gap_s)) | (share == 0.0) | (share == 1.0)


DISTANCES_M = (1, 5, 10)
DURATIONS_S = (1, 5, 10)
LONGEST = 1.5
"""A pair whose ends lie further apart than this many times what was asked, as across a gap, is none."""
ROUNDING_M = 1e-9
"""A path may be that much longer than its sum of floating-point steps: whole steps then end where they should."""

Pairs = tuple[slice | Whole, slice | Whole]
"""Indices of the instants where each pair starts and ends."""


@dataclass(frozen=True, eq=False)
class Instants:
    """The true poses to be met: all (n,); [m], [rad], map frame; heading NaN where it is not known.

    What follows from the truth is computed when first asked for, once for all estimators that are judged by it.
    """

    time_ns: Whole
    x: Floats
    y: Floats
    heading: Floats

    def __len__(self) -> int:
        return len(self.time_ns)

    def at(self, rows: Whole | Flags) -> Instants:
        """Some of them, by index or mask."""
        return Instants(self.time_ns[rows], self.x[rows], self.y[rows], self.heading[rows])

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
    def pairs(self) -> dict[str, Pairs]:
        """From every instant to the first one after at least 1, 5, 10 m of path, ``d_1m`` and so on, or 1, 5, 10 s."""
        path_m, steps_ns = np.concatenate([[0.0], np.cumsum(self.step_m)]), self.time_ns[1:] - self.time_ns[:-1]
        period_ns = int(steps_ns[0]) if len(steps_ns) and steps_ns.min() == steps_ns.max() else 0
        by_distance = {f"d_{reach}m": ahead(path_m, reach - ROUNDING_M) for reach in DISTANCES_M}
        by_time = {f"t_{reach}s": later(self.time_ns, nanoseconds(reach), period_ns) for reach in DURATIONS_S}
        return {**by_distance, **by_time}


def ahead(along: Floats | Whole, reach: float) -> Pairs:
    """Each index and the first one whose ``along`` (n,), which never falls, is at least ``reach`` more."""
    end = np.searchsorted(along, along + reach)
    count = int(np.searchsorted(end, len(along)))
    end = end[:count]
    near = along[end] - along[:count] <= LONGEST * reach
    return (slice(count), end) if near.all() else (np.flatnonzero(near), end[near])


def later(time_ns: Whole, reach_ns: int, period_ns: int) -> Pairs:
    """`ahead` of times: where they come every ``period_ns``, the pairs are plain slices and cost nothing."""
    if not 0 < period_ns <= (LONGEST - 1.0) * reach_ns:
        return ahead(time_ns, reach_ns)
    count = -(-reach_ns // period_ns)
    return slice(max(len(time_ns) - count, 0)), slice(count, None)
