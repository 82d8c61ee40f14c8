"""When an estimator is judged, and by which of its estimates.

The instants belong to the truth, never to the estimator: a filter cannot improve its mean by publishing more often
while it is confident. Matching is causal: at an instant counts the newest estimate that had been received by then and
is about no later time, held constant, and one that is too old counts as none at all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.estimate_track import BEFORE_ALL_NS, Track
from fusion.arrays import Flags, Floats, Whole
from fusion.values import NANOSECONDS, nanoseconds
from logs.truth import GAP_S, RATE_HZ, Instants, TruthTrack, interpolate_truth, known_truth

MAX_AGE_S = 1.0
"""An older estimate counts as none."""
MOST_INSTANTS = 1_000_000
"""Of a run without truth: a stamp that is years off must not cost years of instants."""


class Answers(NamedTuple):
    """Answer at each instant, all (n,): x, y [m], heading [rad], NaN where not known; ``covariance`` (n, 6) as
    in `Track`, NaN where none was claimed. ``valid`` is False, too, for what is too old.

    ``age_s`` is the instant minus the stamp of the newest answer, infinite before the first; ``since_fix_s`` the time
    since the last radio measurement that was used, NaN before the first, or where nothing states what was used.
    """

    valid: Flags
    x: Floats
    y: Floats
    heading: Floats
    covariance: Floats
    age_s: Floats
    since_fix_s: Floats


def match(instants: Instants, track: Track, *, max_age_s: float = MAX_AGE_S) -> Answers:
    """For each instant the newest estimate received by then, and not about a time still to come, as those that follow
    a clock that is ahead; of two with one stamp, the later received.

    Valid when the estimate claims so, its position is finite and ``instant - stamp <= max_age_s`` in whole nanoseconds.
    None is valid of a track with a flaw (`Track.scorable`).
    """
    track = track.scorable
    chosen, received = _newest(instants, track.time_ns, track.received_ns)
    since_fix_s = _since_fix_s(instants, track.received_ns, track.fix_ns)
    return _answers(instants, track.at(chosen), received, since_fix_s, max_age_s)


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
    received = due >= 0
    return newest.take(np.maximum(due, 0)) if len(newest) else newest, received


def _record(stamps: Whole) -> Whole:
    """Index of the greatest of all up to each, of several the last."""
    rising = stamps >= np.maximum.accumulate(stamps)
    return np.asarray(np.maximum.accumulate(np.where(rising, np.arange(len(stamps)), 0)))


def _since_fix_s(instants: Instants, received_ns: Whole, fixes_ns: Whole) -> Floats:
    """Seconds since the newest of ``fixes_ns`` received by each instant, NaN without any."""
    received = np.searchsorted(received_ns, instants.time_ns, side="right")
    last_ns = np.maximum.accumulate(np.concatenate([[BEFORE_ALL_NS], fixes_ns])).take(received)
    return np.where(last_ns > BEFORE_ALL_NS, (instants.time_ns - last_ns) / NANOSECONDS, np.nan)


def _answers(instants: Instants, track: Track, received: Flags, since_fix_s: Floats, max_age_s: float) -> Answers:
    if len(track.time_ns) == 0:
        unknown = np.full(len(received), np.nan)
        no_claim = np.full((len(received), 6), np.nan)
        return Answers(received & False, unknown, unknown, unknown, no_claim, np.full(len(received), np.inf), unknown)
    age_ns = instants.time_ns - track.time_ns
    valid = received & (age_ns <= nanoseconds(max_age_s)) & track.usable
    age_s = np.where(received, age_ns / NANOSECONDS, np.inf)
    x, y, _ = track.pose.T
    return Answers(valid, x, y, track.heading, track.covariance, age_s, since_fix_s)


class Met(NamedTuple):
    """Truth and estimate at the estimate's stamps (n,), the time each stands for [s] (n,), and the share of the time of
    the truth that all together stand for.
    """

    instants: Instants
    answers: Answers
    weight: Floats
    availability: float


def meet(truth: TruthTrack, track: Track, *, gap_s: float = GAP_S) -> Met:
    """Interpolate ``truth`` at the valid stamps of ``track`` that it covers, not across gaps longer than ``gap_s``.

    Of several answers with one stamp the last counts. Each stands for half of the time to its neighbours on either
    side; to one further away than ``gap_s``, for half of ``gap_s``. A track with a flaw has none (`Track.scorable`).
    """
    known, track = known_truth(truth), track.scorable
    rows = _chosen(track, known)
    instants, kept = interpolate_truth(known, track.time_ns[rows], gap_s=gap_s)
    kept &= np.count_nonzero(kept) > 1
    track, instants = track.at(rows[kept]), instants.at(kept)
    x, y, _ = track.pose.T
    now, unknown = np.zeros(len(x)), np.full(len(x), np.nan)
    steps_s = np.minimum(np.diff(instants.time_ns), nanoseconds(gap_s)) / NANOSECONDS
    weight = 0.5 * (np.append(steps_s, 0.0) + np.insert(steps_s, 0, 0.0)) if len(now) else now
    answers = Answers(track.usable, x, y, track.heading, track.covariance, now, unknown)
    gaps_ns = np.diff(known.time_ns)
    watched_s = float(gaps_ns[gaps_ns <= nanoseconds(gap_s)].sum()) / NANOSECONDS
    return Met(instants, answers, weight, min(float(weight.sum()) / watched_s, 1.0) if watched_s else np.nan)


def _chosen(track: Track, known: Instants) -> Whole:
    """Rows of ``track`` in order of time, each stamp once, within the truth."""
    if len(known.time_ns) < 2:
        return np.empty(0, dtype=np.int64)
    inside = (track.time_ns >= known.time_ns[0]) & (track.time_ns <= known.time_ns[-1]) & track.usable
    rows = np.flatnonzero(inside)[::-1]
    _, last = np.unique(track.time_ns[rows], return_index=True)
    return rows[last]
