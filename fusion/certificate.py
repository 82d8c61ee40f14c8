"""The replay certificate: one hash over every estimate and fate of a run, so that two replays can be compared."""

from __future__ import annotations

import struct
from collections.abc import Iterable

from fusion.track import Update


def _numbers(*values: float | None) -> bytes:
    """Floats as little-endian doubles; None as a byte of its own, so that it differs from any number."""
    return b"".join(b"\0" if value is None else b"\1" + struct.pack("<d", value) for value in values)


class Certificate:
    """The hash of all updates so far: what a run that has no end in sight is certified with."""

    def __init__(self) -> None:
        import hashlib

        self._total = hashlib.sha256()

    def add(self, update: Update) -> None:
        """Take in one more update. Reads every number of it, so one that is no number raises here."""
        estimate = update.estimate
        self._total.update(
            struct.pack("<q??q", estimate.time_ns, estimate.valid, estimate.heading_known, estimate.reset_count)
        )
        self._total.update(_numbers(*estimate.pose, *(estimate.covariance or (None,)), estimate.p_lost))
        for fate in update.fates:
            text = f"{fate.time_ns} {fate.sensor} {fate.seq} {fate.anchor} {fate.decision.value} {fate.reason.value}"
            self._total.update(text.encode())
            self._total.update(_numbers(fate.weight, fate.innovation, fate.innovation_variance, fate.nis))

    @property
    def digest(self) -> str:
        """SHA-256 as hexadecimal text."""
        return self._total.hexdigest()


def digest(updates: Iterable[Update]) -> str:
    """SHA-256 of every estimate and fate of ``updates``, in order, as hexadecimal text."""
    certificate = Certificate()
    for update in updates:
        certificate.add(update)
    return certificate.digest
