"""What an estimator said in a run, as bytes of a store: small, and quick to score again."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.track import Track


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
