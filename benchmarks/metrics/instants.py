"""When an estimator is judged, and by which of its estimates.

The instants belong to the truth, never to the estimator: a filter cannot improve its mean by publishing more often
while it is confident. Matching is causal: at an instant counts the newest estimate that had been received by then and
is about no later time, held constant, and one that is too old counts as none at all.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.course import Instants
from benchmarks.metrics.track import BEFORE_ALL_NS, Flags, Floats, Track, Whole
from fusion.values import NANOSECONDS, nanoseconds
from logs.run import TruthTrack

RATE_HZ = 10.0
"""Truth this fast or faster is resampled to this rate; slower truth is taken at its own stamps."""
GAP_S = 0.5
"""Across a longer gap the truth is not interpolated."""
MAX_AGE_S = 1.0
"""An older estimate counts as none."""
MOST_INSTANTS = 1_000_000
"""Of a run without truth: a stamp that is years off must not cost years of instants."""
KEPT_COURSES = 2
"""Truths whose instants are kept: cells come run by run."""


class Answers(NamedTuple):
    """What counts at each instant, all (n,): x, y [m], heading [rad], NaN where not known; ``covariance`` (n, 6) as
    in `Track`, NaN where none was claimed. ``valid`` is False, too, for what is too old.

    ``age_s`` is the instant minus the stamp of the newest answer, infinite before the first; ``since_fix_s`` the time
    since the last radio measurement that was used, NaN before the first, or where nothing says what was used.
    """

    valid: Flags
    x: Floats
    y: Floats
    heading: Floats
    covariance: Floats
    age_s: Floats
    since_fix_s: Floats


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
    # At a stamp of the truth itself the other neighbour, perhaps without a heading, has no say.
    heading = np.select([share == 0.0, share == 1.0], [known.heading[left], known.heading[left + 1]], between)
    resampled = Instants(
        time_ns,
        known.x[left] + share * (known.x[left + 1] - known.x[left]),
        known.y[left] + share * (known.y[left + 1] - known.y[left]),
        heading,
    )
    return resampled, (span_ns <= nanoseconds(gap_s)) | (share == 0.0) | (share == 1.0)


def match(instants: Instants, track: Track, *, max_age_s: float = MAX_AGE_S) -> Answers:
    """For each instant the newest estimate received by then, and not about a time still to come, as those that follow
    a clock that is ahead; of two with one stamp, the later received.

    Valid when the estimator says so, its position is finite and ``instant - stamp <= max_age_s`` in whole nanoseconds.
    None is valid of a track with a flaw (`Track.scorable`).
    """
    track = track.scorable
    chosen, heard = _newest(instants, track.time_ns, track.received_ns)
    since_fix_s = _since_fix_s(instants, track.received_ns, track.fix_ns)
    return _answers(instants, track.at(chosen), heard, since_fix_s, max_age_s)


def availability(track: Track) -> float:
    """Share of the time of a run without truth, from its first measurement to its last, that has a valid answer; NaN
    where nothing was answered.
    """
    if len(track.received_ns) == 0:
        return math.nan
    first_ns, last_ns = track.received_ns[[0, -1]].tolist()
    period_ns = max(nanoseconds(1.0 / RATE_HZ), (last_ns - first_ns) // MOST_INSTANTS)
    time_ns = np.arange(first_ns, last_ns + 1, period_ns)
    unknown = np.full(len(time_ns), math.nan)
    return float(match(Instants(time_ns, unknown, unknown, unknown), track).valid.mean())


def _newest(instants: Instants, stamp_ns: Whole, received_ns: Whole) -> tuple[Whole, Flags]:
    """Index of the newest stamp received by each instant, and whether any was; no index at all without stamps."""
    due_ns, newest = np.maximum(received_ns, stamp_ns), np.arange(len(stamp_ns))
    if not (stamp_ns[1:] >= stamp_ns[:-1]).all():
        by_due = np.argsort(due_ns, kind="stable")
        due_ns, newest = due_ns[by_due], by_due[_record(stamp_ns[by_due])]
    due = np.searchsorted(due_ns, instants.time_ns, side="right") - 1
    heard = due >= 0
    return newest.take(np.maximum(due, 0)) if len(newest) else newest, heard


def _record(stamps: Whole) -> Whole:
    """Index of the greatest of all up to each, of several the last."""
    rising = stamps >= np.maximum.accumulate(stamps)
    return np.asarray(np.maximum.accumulate(np.where(rising, np.arange(len(stamps)), 0)))


def _since_fix_s(instants: Instants, received_ns: Whole, fixes_ns: Whole) -> Floats:
    """Seconds since the newest of ``fixes_ns`` received by each instant, NaN without any."""
    received = np.searchsorted(received_ns, instants.time_ns, side="right")
    last_ns = np.maximum.accumulate(np.concatenate([[BEFORE_ALL_NS], fixes_ns])).take(received)
    return np.where(last_ns > BEFORE_ALL_NS, (instants.time_ns - last_ns) / NANOSECONDS, np.nan)


def _answers(instants: Instants, said: Track, heard: Flags, since_fix_s: Floats, max_age_s: float) -> Answers:
    if len(said.time_ns) == 0:
        unknown = np.full(len(heard), np.nan)
        no_claim = np.full((len(heard), 6), np.nan)
        return Answers(heard & False, unknown, unknown, unknown, no_claim, np.full(len(heard), np.inf), unknown)
    age_ns = instants.time_ns - said.time_ns
    valid = heard & (age_ns <= nanoseconds(max_age_s)) & said.usable
    age_s = np.where(heard, age_ns / NANOSECONDS, np.inf)
    x, y, _ = said.pose.T
    return Answers(valid, x, y, said.heading, said.covariance, age_s, since_fix_s)
