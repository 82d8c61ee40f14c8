"""Track and fates of an estimator in a run, as bytes of a store: small, and quick to score again."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.fates import FateColumns

ARCHIVE_VERSION = 2
"""Changes whenever the bytes do, so that older ones are not taken for these."""


def to_bytes(track: Track, fates: FateColumns) -> bytes:
    """Both as one NPZ file. Columns of a kind are one array, for each array takes longer to read than its numbers."""
    buffer = BytesIO()
    np.savez(
        buffer,
        track_ns=[track.received_ns, track.time_ns, track.fix_ns],
        track_pose=track.pose,
        track_covariance=track.covariance,
        track_flags=[track.valid, track.heading_known],
        fate_ns=fates.time_ns,
        fate_codes=[fates.kind, fates.sensor, fates.anchor, fates.decision, fates.reason],
        fate_numbers=[fates.weight, fates.innovation, fates.innovation_variance, fates.nis],
        fate_names=fates.names,
    )
    return buffer.getvalue()


def from_bytes(content: bytes) -> tuple[Track, FateColumns]:
    """The reverse of `to_bytes`. Raises `ValueError`, `KeyError`, `EOFError` or `BadZipFile` for anything else."""
    with np.load(BytesIO(content), allow_pickle=False) as stored:
        received_ns, time_ns, fix_ns = stored["track_ns"]
        valid, heading_known = stored["track_flags"]
        pose, covariance = stored["track_pose"], stored["track_covariance"]
        track = Track(received_ns, time_ns, pose, covariance, valid, heading_known, fix_ns)
        kind, sensor, anchor, decision, reason = stored["fate_codes"]
        weight, innovation, variance, nis = stored["fate_numbers"]
        codes = (kind, sensor, anchor, decision, reason)
        return track, FateColumns(stored["fate_ns"], *codes, weight, innovation, variance, nis, stored["fate_names"])
