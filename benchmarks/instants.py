"""When an estimator is judged, and by which of its estimates.

The instants belong to the truth, never to the estimator: a filter cannot improve its mean by publishing more often
while it is confident. Matching is causal: at an instant counts the newest estimate that had been received by then,
held constant, and one that is too old counts as none at all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.track import Floats, Stamps, Track
from fusion.values import nanoseconds
from logs.run import TruthTrack

RATE_HZ = 10.0
"""Truth this fast or faster is resampled to this rate; slower truth is taken at its own stamps."""
GAP_S = 0.5
"""Across a longer gap the truth is not interpolated."""
MAX_AGE_S = 1.0
"""An older estimate counts as none."""


class Instants(NamedTuple):
    """The true poses to be met: all (n,); [m], [rad], map frame; heading NaN where it is not known."""

    time_ns: Stamps
    x: Floats
    y: Floats
    heading: Floats


class Answers(NamedTuple):
    """What an estimator said at each instant. ``valid`` (n,); x, y [m], heading [rad] (n,), NaN where not known;
    ``covariance`` (n, 3, 3), NaN where none was claimed.
    """

    valid: NDArray[np.bool_]
    x: Floats
    y: Floats
    heading: Floats
    covariance: Floats


def wrap_angles(angles: Floats) -> Floats:
    """Angles [rad] brought into [-pi, pi): `fusion.wrap_angle` for arrays."""
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)


def evaluation_instants(truth: TruthTrack, *, hz: float = RATE_HZ, gap_s: float = GAP_S) -> Instants:
    """The truth's own stamps when its median rate is below ``hz``, else its clock resampled uniformly at ``hz``.

    Position is interpolated linearly, heading along the shortest arc, nothing is extrapolated. Resampled instants
    inside a gap longer than ``gap_s`` are left out.
    """
    known = _known(truth)
    gaps_ns = np.diff(known.time_ns)
    period_ns = nanoseconds(1.0 / hz)
    if len(gaps_ns) == 0 or np.median(gaps_ns) > period_ns:
        return known
    return _resampled(known, np.arange(known.time_ns[0], known.time_ns[-1] + 1, period_ns), nanoseconds(gap_s))


def _known(truth: TruthTrack) -> Instants:
    """The truth in time order, each stamp once, without positions that are not finite."""
    finite = np.flatnonzero(np.isfinite(truth.x) & np.isfinite(truth.y))
    time_ns, first = np.unique(truth.time_ns[finite], return_index=True)
    chosen = finite[first]
    return Instants(time_ns, truth.x[chosen], truth.y[chosen], truth.heading[chosen])


def _resampled(known: Instants, time_ns: Stamps, gap_ns: int) -> Instants:
    left = np.minimum(np.searchsorted(known.time_ns, time_ns, side="right") - 1, len(known.time_ns) - 2)
    span_ns = known.time_ns[left + 1] - known.time_ns[left]
    share = (time_ns - known.time_ns[left]) / span_ns
    turn = wrap_angles(known.heading[left + 1] - known.heading[left])
    between = wrap_angles(known.heading[left] + share * turn)
    # At a stamp of the truth itself the other neighbour, perhaps without a heading, has no say.
    heading = np.select([share == 0.0, share == 1.0], [known.heading[left], known.heading[left + 1]], between)
    resampled = Instants(
        time_ns,
        known.x[left] + share * (known.x[left + 1] - known.x[left]),
        known.y[left] + share * (known.y[left + 1] - known.y[left]),
        heading,
    )
    kept = (span_ns <= gap_ns) | (share == 0.0) | (share == 1.0)
    return Instants(*(column[kept] for column in resampled))


def match(instants: Instants, track: Track, *, max_age_s: float = MAX_AGE_S) -> Answers:
    """For each instant the newest estimate received by then; of two with one stamp, the later received.

    Valid when the estimator says so, its position is finite and ``instant - stamp <= max_age_s`` in whole nanoseconds.
    """
    if len(track.stamp_ns) == 0:
        return _no_answers(len(instants.time_ns))
    rising = track.stamp_ns >= np.maximum.accumulate(track.stamp_ns)
    newest = np.maximum.accumulate(np.where(rising, np.arange(len(rising)), 0))
    received = np.searchsorted(track.received_ns, instants.time_ns, side="right") - 1
    chosen = newest[np.maximum(received, 0)]
    fresh = (received >= 0) & (instants.time_ns - track.stamp_ns[chosen] <= nanoseconds(max_age_s))
    x, y, heading = track.pose[chosen].T
    known = track.heading_known[chosen] & np.isfinite(heading)
    return Answers(
        fresh & track.valid[chosen] & np.isfinite(x) & np.isfinite(y),
        x,
        y,
        np.where(known, heading, np.nan),
        track.covariance_matrices[chosen],
    )


def _no_answers(count: int) -> Answers:
    unknown = np.full(count, np.nan)
    return Answers(np.zeros(count, dtype=bool), unknown, unknown, unknown, np.full((count, 3, 3), np.nan))
