"""What an estimator said in a run, as columns: quick to score, small to store.

Updates are objects, one per measurement; every metric wants arrays. They are turned over once, here.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion import Decision, Fate, Reason, Update

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]
Flags = NDArray[np.bool_]
Codes = NDArray[np.int16]

DECISIONS, REASONS = tuple(Decision), tuple(Reason)
_NONE = (np.nan,) * 6
_BEFORE_ALL = np.iinfo(np.int64).min


class Track(NamedTuple):
    """Estimates in the order they were made, n rows.

    ``received_ns``: when each was there, the newest stamp among the messages received by then, so it never decreases;
    a message whose own clock was refused says nothing about the time. ``stamp_ns``: the time it is about. ``pose``
    (n, 3) [m, m, rad]. ``covariance`` (n, 6), in the order of `fusion.Covariance`, NaN where none was claimed.
    """

    received_ns: Stamps
    stamp_ns: Stamps
    pose: Floats
    covariance: Floats
    valid: Flags
    heading_known: Flags
    reset_count: NDArray[np.int64]

    @classmethod
    def of(cls, updates: Sequence[Update]) -> Track:
        """The columns of all updates of one lane, revisions among them."""
        estimates = [update.estimate for update in updates]
        clocks = [_BEFORE_ALL if _is_bad_clock(update) else update.measurement.time_ns for update in updates]
        return cls(
            np.maximum.accumulate(np.array(clocks, dtype=np.int64)) if clocks else np.zeros(0, np.int64),
            np.array([estimate.time_ns for estimate in estimates], dtype=np.int64),
            np.array([estimate.pose for estimate in estimates], dtype=np.float64).reshape(-1, 3),
            np.array([estimate.covariance or _NONE for estimate in estimates], dtype=np.float64).reshape(-1, 6),
            np.array([estimate.valid for estimate in estimates], dtype=bool),
            np.array([estimate.heading_known for estimate in estimates], dtype=bool),
            np.array([estimate.reset_count for estimate in estimates], dtype=np.int64),
        )

    @property
    def covariance_matrices(self) -> Floats:
        """(n, 3, 3)."""
        return self.covariance[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)

    @property
    def is_sound(self) -> bool:
        """Whether every number is one; what is not claimed, a pose not valid or a heading not known, may be any."""
        finite = np.isfinite(self.pose)
        whole = finite[:, 0] & finite[:, 1] & (finite[:, 2] | ~self.heading_known)
        return bool(np.all(whole | ~self.valid))


def _is_bad_clock(update: Update) -> bool:
    return bool(update.fates) and update.fates[0].reason is Reason.BAD_CLOCK


class FateColumns(NamedTuple):
    """The last word on every reading, m rows. ``sensor`` and ``anchor`` count into ``names``; ``decision`` and
    ``reason`` into `DECISIONS` and `REASONS`. Innovations are NaN where a method predicts none.
    """

    time_ns: Stamps
    sensor: Codes
    anchor: Codes
    decision: Codes
    reason: Codes
    weight: Floats
    innovation: Floats
    innovation_variance: Floats
    nis: Floats
    names: NDArray[np.str_]

    @classmethod
    def of(cls, fates: Sequence[Fate]) -> FateColumns:
        """The columns of fates in time order."""
        names = sorted({name for fate in fates for name in (fate.sensor, fate.anchor)})
        place = {name: code for code, name in enumerate(names)}
        decisions, reasons = ({item: code for code, item in enumerate(items)} for items in (DECISIONS, REASONS))
        numbers = [(fate.weight, fate.innovation, fate.innovation_variance, fate.nis) for fate in fates]
        weight, innovation, variance, nis = np.array(numbers, dtype=np.float64).reshape(-1, 4).T
        return cls(
            np.array([fate.time_ns for fate in fates], dtype=np.int64),
            np.array([place[fate.sensor] for fate in fates], dtype=np.int16),
            np.array([place[fate.anchor] for fate in fates], dtype=np.int16),
            np.array([decisions[fate.decision] for fate in fates], dtype=np.int16),
            np.array([reasons[fate.reason] for fate in fates], dtype=np.int16),
            weight,
            innovation,
            variance,
            nis,
            np.array(names, dtype=np.str_),
        )

    @property
    def counts(self) -> dict[str, int]:
        """How many readings met each decision."""
        found = np.bincount(self.decision, minlength=len(DECISIONS))
        return {decision.value: int(count) for decision, count in zip(DECISIONS, found, strict=True)}

    @property
    def nis_mean(self) -> float | None:
        """Over all readings that have one; None where there are none, or not all are finite."""
        known = self.nis[~np.isnan(self.nis)]
        return float(known.mean()) if len(known) and np.isfinite(known).all() else None


def to_bytes(track: Track, fates: FateColumns) -> bytes:
    """Both as one NPZ file."""
    buffer = BytesIO()
    columns = {f"track_{name}": column for name, column in track._asdict().items()}
    columns |= {f"fates_{name}": column for name, column in fates._asdict().items()}
    np.savez(buffer, **columns)
    return buffer.getvalue()


def from_bytes(content: bytes) -> tuple[Track, FateColumns]:
    """What `to_bytes` has written."""
    with np.load(BytesIO(content), allow_pickle=False) as stored:
        track = Track(*(stored[f"track_{name}"] for name in Track._fields))
        return track, FateColumns(*(stored[f"fates_{name}"] for name in FateColumns._fields))
