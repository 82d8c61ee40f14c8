"""When an estimator is judged, and by which of its estimates.

The instants belong to the truth, never to the estimator: a filter cannot improve its mean by publishing more often
while it is confident. Matching is causal: at an instant counts the newest estimate that had been received by then,
held constant, and one that is too old counts as none at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion import Decision, Estimate, Ranges, Reason, Update, WifiScan
from fusion.values import NANOSECONDS, nanoseconds
from logs.run import TruthTrack

RATE_HZ = 10.0
"""Truth this fast or faster is resampled to this rate; slower truth is taken at its own stamps."""
GAP_S = 0.5
"""Across a longer gap the truth is not interpolated."""
MAX_AGE_S = 1.0
"""An older estimate counts as none."""
BEFORE_ALL_NS = np.iinfo(np.int64).min
SYMMETRIC = [0, 1, 2, 1, 3, 4, 2, 4, 5]
"""Where the nine numbers of a covariance stand among the six of `fusion.Covariance`."""
NO_CLAIM = (np.nan,) * 6

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Instants(NamedTuple):
    """The true poses to be met: all (n,); [m], [rad], map frame; heading NaN where it is not known."""

    time_ns: Whole
    x: Floats
    y: Floats
    heading: Floats

    def at(self, rows: Whole | Flags) -> Instants:
        """Some of them, by index or mask."""
        return Instants(self.time_ns[rows], self.x[rows], self.y[rows], self.heading[rows])


class Track(NamedTuple):
    """What an estimator said, in the order it was heard, all (m,): stamp [ns], whether it claims to be valid and is
    finite, x, y [m], heading [rad], NaN where not known; ``covariance`` (m, 3, 3), NaN where none was claimed.
    """

    time_ns: Whole
    valid: Flags
    x: Floats
    y: Floats
    heading: Floats
    covariance: Floats

    def at(self, rows: Whole) -> Track:
        """Some of it, by index."""
        pose = self.x[rows], self.y[rows], self.heading[rows]
        return Track(self.time_ns[rows], self.valid[rows], *pose, self.covariance[rows])


class Answers(NamedTuple):
    """What counts at each instant: as in `Track`, (n,). ``valid`` is False, too, for what is too old.

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
    """Angles [rad] brought into [-pi, pi): `fusion.wrap_angle` for arrays."""
    return np.asarray((angles + np.pi) % (2.0 * np.pi) - np.pi)


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


def reception_ns(updates: Sequence[Update]) -> Whole:
    """When each update was there, (m,): the newest stamp among the messages received by then.

    Updates stand in the order of arrival, so this never decreases. A message whose own clock was refused says
    nothing about the time.
    """
    clocks = [BEFORE_ALL_NS if _is_bad_clock(update) else update.measurement.time_ns for update in updates]
    return np.maximum.accumulate(np.array(clocks, dtype=np.int64))


def _is_bad_clock(update: Update) -> bool:
    return bool(update.fates) and update.fates[0].reason is Reason.BAD_CLOCK


def match(instants: Instants, updates: Sequence[Update], *, max_age_s: float = MAX_AGE_S) -> Answers:
    """For each instant the newest estimate received by then; of two with one stamp, the later received.

    Valid when the estimator says so, its position is finite and ``instant - stamp <= max_age_s`` in whole nanoseconds.
    """
    received_ns = reception_ns(updates)
    stamp_ns = np.array([update.estimate.time_ns for update in updates], dtype=np.int64)
    chosen, heard = _newest(instants, stamp_ns, received_ns)
    said = track_of([updates[i].estimate for i in chosen])
    fixes_ns = np.array([update.measurement.time_ns if _is_fix(update) else BEFORE_ALL_NS for update in updates])
    return _answers(instants, said, heard, _since_fix_s(instants, received_ns, fixes_ns), max_age_s)


def match_track(instants: Instants, track: Track, *, max_age_s: float = MAX_AGE_S) -> Answers:
    """The same of a track alone: each answer was there as soon as the newest stamp before it in the track."""
    chosen, heard = _newest(instants, track.time_ns, np.maximum.accumulate(track.time_ns))
    return _answers(instants, track.at(chosen), heard, np.full(len(heard), np.nan), max_age_s)


def _newest(instants: Instants, stamp_ns: Whole, received_ns: Whole) -> tuple[Whole, Flags]:
    """Index of the newest stamp received by each instant, and whether any was; no index at all without stamps."""
    rising = stamp_ns >= np.maximum.accumulate(stamp_ns)
    newest = np.maximum.accumulate(np.where(rising, np.arange(len(stamp_ns)), 0))
    received = np.searchsorted(received_ns, instants.time_ns, side="right") - 1
    heard = received >= 0
    return newest[np.maximum(received, 0)] if len(newest) else newest, heard


def _is_fix(update: Update) -> bool:
    """Whether a radio measurement, which alone knows where the robot is, was believed, at least in part."""
    if not isinstance(update.measurement, WifiScan | Ranges):
        return False
    return any(fate.decision in (Decision.USED, Decision.DOWNWEIGHTED) and fate.weight > 0.0 for fate in update.fates)


def _since_fix_s(instants: Instants, received_ns: Whole, fixes_ns: Whole) -> Floats:
    """Seconds since the newest of ``fixes_ns`` received by each instant, NaN without any."""
    since = np.full(len(instants.time_ns), np.nan)
    received = np.searchsorted(received_ns, instants.time_ns, side="right") - 1
    last_ns = np.maximum.accumulate(np.concatenate([[BEFORE_ALL_NS], fixes_ns]))[received + 1]
    some = last_ns > BEFORE_ALL_NS
    since[some] = (instants.time_ns[some] - last_ns[some]) / NANOSECONDS
    return since


def track_of(estimates: Sequence[Estimate]) -> Track:
    """Estimates as columns."""
    pose = np.array([estimate.pose for estimate in estimates], dtype=np.float64).reshape(-1, 3)
    covariance = [NO_CLAIM if e.covariance is None else e.covariance for e in estimates]
    claimed = np.array([estimate.valid for estimate in estimates], dtype=bool)
    heading_known = np.array([estimate.heading_known for estimate in estimates], dtype=bool)
    return Track(
        np.array([estimate.time_ns for estimate in estimates], dtype=np.int64),
        claimed & np.isfinite(pose[:, 0]) & np.isfinite(pose[:, 1]),
        pose[:, 0],
        pose[:, 1],
        np.where(heading_known & np.isfinite(pose[:, 2]), pose[:, 2], np.nan),
        np.array(covariance, dtype=np.float64).reshape(-1, 6)[:, SYMMETRIC].reshape(-1, 3, 3),
    )


def _answers(instants: Instants, said: Track, heard: Flags, since_fix_s: Floats, max_age_s: float) -> Answers:
    if len(said.time_ns) == 0:
        unknown = np.full(len(heard), np.nan)
        nothing = np.full((len(heard), 3, 3), np.nan)
        return Answers(heard & False, unknown, unknown, unknown, nothing, np.full(len(heard), np.inf), unknown)
    age_ns = instants.time_ns - said.time_ns
    valid = heard & (age_ns <= nanoseconds(max_age_s)) & said.valid
    age_s = np.where(heard, age_ns / NANOSECONDS, np.inf)
    return Answers(valid, said.x, said.y, said.heading, said.covariance, age_s, since_fix_s)
