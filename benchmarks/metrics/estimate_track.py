"""Estimates of a run as columns: quick to score, small to store.

Updates are objects, one per measurement; every metric wants arrays. They are turned over once, here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fusion import Decision, Estimate, Ranges, Reason, Update, WifiScan
from fusion.arrays import Flags, Floats, Stamps, Whole
from fusion.timeline import Key, order
from fusion.values import NANOSECONDS

BEFORE_ALL_NS = np.iinfo(np.int64).min
NO_CLAIM = (np.nan,) * 6
UNSOUND_CLAIM = (np.nan,) * 5 + (np.inf,)
POSITION_CLAIM, HEADING_CLAIM = [0, 1, 3], [2, 4, 5]
"""Of the numbers of a `fusion.Covariance`."""
BELIEVED = (Decision.USED, Decision.DOWNWEIGHTED)


class Track(NamedTuple):
    """Estimates in the order of arrival, n rows.

    ``received_ns``: when each was there, the newest true stamp among the messages received by then, so it never
    decreases; a message whose own clock was refused states no time. ``time_ns``: the time it is about.
    ``pose`` (n, 3) [m, m, rad]. ``covariance`` (n, 6), in the order of `fusion.Covariance`, NaN where none was claimed;
    of one that was claimed and is all NaN the last number is infinite.
    ``fix_ns``: the true stamp of the radio measurement that was believed just then, or `BEFORE_ALL_NS`.
    """

    received_ns: Stamps
    time_ns: Stamps
    pose: Floats
    covariance: Floats
    valid: Flags
    heading_known: Flags
    fix_ns: Stamps

    @classmethod
    def of(cls, updates: Sequence[Update], true_stamps: Mapping[Key, int] = MappingProxyType({})) -> Track:
        """The columns of all updates of one estimator, revisions among them; ``true_stamps`` as in `logs.run.Run`."""
        stamps = [true_stamps.get(order(update.measurement), update.measurement.time_ns) for update in updates]
        stamped = list(zip(updates, stamps, strict=True))
        clocks = [BEFORE_ALL_NS if _is_bad_clock(update) else stamp for update, stamp in stamped]
        fixes = [stamp if _is_fix(update) else BEFORE_ALL_NS for update, stamp in stamped]
        track = cls.of_estimates([update.estimate for update in updates])
        received = np.maximum.accumulate(np.array(clocks, dtype=np.int64))
        return track._replace(received_ns=received, fix_ns=np.array(fixes, dtype=np.int64))

    @classmethod
    def of_estimates(cls, estimates: Sequence[Estimate]) -> Track:
        """Estimates alone: each was there as soon as the newest stamp before it, and no fix is known."""
        time_ns = np.array([estimate.time_ns for estimate in estimates], dtype=np.int64)
        return cls(
            np.maximum.accumulate(time_ns),
            time_ns,
            np.array([estimate.pose for estimate in estimates], dtype=np.float64).reshape(-1, 3),
            np.array([_claim(estimate) for estimate in estimates], dtype=np.float64).reshape(-1, 6),
            np.array([estimate.valid for estimate in estimates], dtype=bool),
            np.array([estimate.heading_known for estimate in estimates], dtype=bool),
            np.full(len(time_ns), BEFORE_ALL_NS),
        )

    @classmethod
    def of_poses(cls, time_ns: Stamps, x: Floats, y: Floats, heading: Floats) -> Track:
        """Poses alone, all (n,): valid, without a covariance; a heading of NaN is not known."""
        count = len(time_ns)
        return cls(
            np.maximum.accumulate(time_ns),
            time_ns,
            np.stack([x, y, heading], axis=1),
            np.full((count, 6), np.nan),
            np.ones(count, dtype=bool),
            np.isfinite(heading),
            np.full(count, BEFORE_ALL_NS),
        )

    def at(self, rows: Whole) -> Track:
        """Some of it, by index."""
        return Track(
            self.received_ns.take(rows),
            self.time_ns.take(rows),
            self.pose.take(rows, axis=0),
            self.covariance.take(rows, axis=0),
            self.valid.take(rows),
            self.heading_known.take(rows),
            self.fix_ns.take(rows),
        )

    @property
    def usable(self) -> Flags:
        """Whether each claims to be valid, and is a position."""
        return self.valid & np.isfinite(self.pose[:, 0]) & np.isfinite(self.pose[:, 1])

    @property
    def heading(self) -> Floats:
        """[rad], NaN where it is not known."""
        return np.where(self.heading_known & np.isfinite(self.pose[:, 2]), self.pose[:, 2], np.nan)

    @property
    def flaw(self) -> str:
        """The reason why nothing can be scored: the first answer that is no number; "" where all are. A pose
        that is not valid, or a heading that is not known, may be anything.
        """
        unsound = np.flatnonzero(self.valid & ~(self._is_pose & self._is_claim))
        if len(unsound) == 0:
            return ""
        row = unsound[0]
        x, y, heading = self.pose[row]
        answer = "a covariance of NaN" if self._is_pose[row] else f"x {x:g} m, y {y:g} m, heading {heading:g} rad"
        after_s = (self.time_ns[row] - self.time_ns[0]) / NANOSECONDS
        return f"it answers {answer}, {after_s:g} s after its first answer, so none of its answers is scored"

    @property
    def scorable(self) -> Track:
        """Itself, and of one with a flaw no answer at all: the part before the flaw is no result."""
        return self.at(np.empty(0, dtype=np.int64)) if self.flaw else self

    @property
    def _is_pose(self) -> Flags:
        finite = np.isfinite(self.pose)
        return np.asarray(finite[:, 0] & finite[:, 1] & (finite[:, 2] | ~self.heading_known))

    @property
    def _is_claim(self) -> Flags:
        """Whether what is claimed of the variances is a number, or nothing is claimed."""
        missing = np.isnan(self.covariance)
        if not missing.any():
            return np.ones(len(missing), dtype=bool)
        spoilt = missing[:, POSITION_CLAIM].any(axis=1) | (missing[:, HEADING_CLAIM].any(axis=1) & self.heading_known)
        return np.asarray(missing.all(axis=1) | ~spoilt)


def _claim(estimate: Estimate) -> tuple[float, ...]:
    claimed = estimate.covariance
    if claimed is None:
        return NO_CLAIM
    return UNSOUND_CLAIM if all(map(math.isnan, claimed)) else claimed


def _is_bad_clock(update: Update) -> bool:
    return bool(update.fates) and update.fates[0].reason is Reason.BAD_CLOCK


def _is_fix(update: Update) -> bool:
    """Whether a radio measurement, which alone knows where the robot is, was believed, at least in part."""
    if not isinstance(update.measurement, WifiScan | Ranges):
        return False
    return any(fate.decision in BELIEVED and fate.weight > 0.0 for fate in update.fates)
