"""What an estimator said in a run, as columns: quick to score, small to store.

Updates are objects, one per measurement; every metric wants arrays. They are turned over once, here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion import Decision, Estimate, Ranges, Reason, Update, WifiScan
from fusion.timeline import Key, order

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
Stamps = Whole
Points = NDArray[np.complex128]
Flags = NDArray[np.bool_]

BEFORE_ALL_NS = np.iinfo(np.int64).min
NO_CLAIM = (np.nan,) * 6
BELIEVED = (Decision.USED, Decision.DOWNWEIGHTED)


def points(x: Floats, y: Floats) -> Points:
    """Points of the plane as complex numbers, (n,): x + iy."""
    plane = np.empty(len(x), dtype=np.complex128)
    plane.real, plane.imag = x, y
    return plane


class Track(NamedTuple):
    """Estimates in the order they were heard, n rows.

    ``received_ns``: when each was there, the newest true stamp among the messages received by then, so it never
    decreases; a message whose own clock was refused says nothing about the time. ``time_ns``: the time it is about.
    ``pose`` (n, 3) [m, m, rad]. ``covariance`` (n, 6), in the order of `fusion.Covariance`, NaN where none was claimed.
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
        """The columns of all updates of one lane, revisions among them; ``true_stamps`` as in `logs.run.Run`."""
        stamps = [true_stamps.get(order(update.measurement), update.measurement.time_ns) for update in updates]
        told = list(zip(updates, stamps, strict=True))
        clocks = [BEFORE_ALL_NS if _is_bad_clock(update) else stamp for update, stamp in told]
        fixes = [stamp if _is_fix(update) else BEFORE_ALL_NS for update, stamp in told]
        said = cls.of_estimates([update.estimate for update in updates])
        received = np.maximum.accumulate(np.array(clocks, dtype=np.int64))
        return said._replace(received_ns=received, fix_ns=np.array(fixes, dtype=np.int64))

    @classmethod
    def of_estimates(cls, estimates: Sequence[Estimate]) -> Track:
        """Estimates alone: each was there as soon as the newest stamp before it, and nothing says what was believed."""
        time_ns = np.array([estimate.time_ns for estimate in estimates], dtype=np.int64)
        return cls(
            np.maximum.accumulate(time_ns),
            time_ns,
            np.array([estimate.pose for estimate in estimates], dtype=np.float64).reshape(-1, 3),
            np.array([estimate.covariance or NO_CLAIM for estimate in estimates], dtype=np.float64).reshape(-1, 6),
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
    def is_sound(self) -> bool:
        """Whether every number is one; what is not claimed, a pose not valid or a heading not known, may be any."""
        finite = np.isfinite(self.pose)
        whole = finite[:, 0] & finite[:, 1] & (finite[:, 2] | ~self.heading_known)
        return bool(np.all(whole | ~self.valid))


def _is_bad_clock(update: Update) -> bool:
    return bool(update.fates) and update.fates[0].reason is Reason.BAD_CLOCK


def _is_fix(update: Update) -> bool:
    """Whether a radio measurement, which alone knows where the robot is, was believed, at least in part."""
    if not isinstance(update.measurement, WifiScan | Ranges):
        return False
    return any(fate.decision in BELIEVED and fate.weight > 0.0 for fate in update.fates)
