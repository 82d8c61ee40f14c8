"""The other way to meet: at the estimate's own stamps, as tools for recorded trajectories do it.

Nothing is causal here, and what an estimator left out is not in the errors: read them with the availability beside
them, and rank by the causal ones. Pairing by nearest stamps is not offered: at 1 m/s, stamps that are 24 ms apart
would make a perfect estimate 24 mm wrong, and here they do not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.metrics.course import Instants
from benchmarks.metrics.instants import GAP_S, Answers, interpolate_truth, known_truth
from benchmarks.metrics.track import Floats, Track, Whole
from fusion.values import NANOSECONDS, nanoseconds
from logs.run import TruthTrack


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
    said, instants = track.at(rows[kept]), instants.at(kept)
    x, y, _ = said.pose.T
    now, unknown = np.zeros(len(x)), np.full(len(x), np.nan)
    steps_s = np.minimum(np.diff(instants.time_ns), nanoseconds(gap_s)) / NANOSECONDS
    weight = 0.5 * (np.append(steps_s, 0.0) + np.insert(steps_s, 0, 0.0)) if len(now) else now
    answers = Answers(said.usable, x, y, said.heading, said.covariance, now, unknown)
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
