"""The replay certificate: one hash over a run of an estimator, so that two replays can be compared.

It covers the motion of every epoch, what became of every reading, the estimate at every epoch and the newest one. What
happens between two epochs follows from these, so an estimate there need not be computed to be certified.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

from fusion.fold import Update
from fusion.motion import Increment
from fusion.values import Estimate, Fate


def _numbers(*values: float | None) -> bytes:
    """Floats as little-endian doubles; None as a byte of its own, so that it differs from any number."""
    return b"".join(b"\0" if value is None else b"\1" + struct.pack("<d", value) for value in values)


class Certificate:
    """The hash of all updates so far: what a run that has no end in sight is certified with."""

    def __init__(self) -> None:
        import hashlib

        self._total = hashlib.sha256()
        self._newest: Update | None = None

    def add(self, update: Update) -> None:
        """Take in one more update. Reads every number of it, so one that is no number raises here."""
        self._newest = update
        for epoch in update.epochs:
            self._add_motion(epoch.motion)
        for fate in update.fates:
            self._add_fate(fate)
        if update.epochs:
            self._total.update(_estimate(update.estimate))

    def _add_motion(self, motion: Increment) -> None:
        x, y, heading, covariance, *rest = motion
        self._total.update(struct.pack("<16dq", x, y, heading, *covariance, *rest))

    def _add_fate(self, fate: Fate) -> None:
        text = f"{fate.time_ns} {fate.sensor} {fate.seq} {fate.anchor} {fate.decision.value} {fate.reason.value}"
        self._total.update(text.encode())
        self._total.update(_numbers(fate.weight, fate.innovation, fate.innovation_variance, fate.nis))

    @property
    def digest(self) -> str:
        """SHA-256 as hexadecimal text; the newest estimate is in it, for what follows the last epoch counts too."""
        total = self._total.copy()
        if self._newest is not None:
            total.update(_estimate(self._newest.estimate))
        return total.hexdigest()


def _estimate(estimate: Estimate) -> bytes:
    flags = struct.pack("<q??q", estimate.time_ns, estimate.valid, estimate.heading_known, estimate.reset_count)
    return flags + _numbers(*estimate.pose, *(estimate.covariance or (None,)), estimate.p_lost)


def digest(updates: Iterable[Update]) -> str:
    """SHA-256 of the motion, fates and estimates of ``updates``, in order, as hexadecimal text."""
    certificate = Certificate()
    for update in updates:
        certificate.add(update)
    return certificate.digest
