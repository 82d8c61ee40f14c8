"""The path and the flags of an estimator as columns for drawing: final estimates, in time order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.fates import field
from benchmarks.review.canvas import thinned
from fusion import Update
from fusion.arrays import Flags, Floats, Stamps, Whole


class EstimateColumns(NamedTuple):
    """Flags and times of an estimator's estimates in time order, all (n,)."""

    time_ns: Stamps
    valid: Flags
    p_lost: Floats
    reset_count: Whole

    @classmethod
    def of_updates(cls, updates: Sequence[Update]) -> EstimateColumns:
        """The estimates of ``updates``; ``p_lost`` is NaN where a method has no opinion."""
        estimates = [update.estimate for update in updates]
        time_ns, _, _, valid, _, p_lost, reset_count, _ = (field(estimates, i) for i in range(8))
        return cls(
            np.fromiter(time_ns, np.int64, len(estimates)),
            np.fromiter(valid, np.bool_, len(estimates)),
            np.array(list(p_lost), dtype=np.float64),
            np.fromiter(reset_count, np.int64, len(estimates)),
        )


class DrawnTrack(NamedTuple):
    """The valid positions of an estimator, thinned: all (n,); ``covariance`` (n, 6) of (x, y, heading) row by row
    above the diagonal [m², m rad, rad²], NaN where none is claimed.
    """

    time_ns: Stamps
    xy: Floats
    covariance: Floats

    @classmethod
    def of_updates(cls, updates: Sequence[Update], valid: Flags) -> DrawnTrack:
        """Of ``updates`` in time order; ``valid`` (n,): which of them hold a position."""
        chosen = [updates[i].estimate for i in thinned(np.flatnonzero(valid))]
        time_ns = np.array([estimate.time_ns for estimate in chosen], dtype=np.int64)
        xy = np.array([estimate.pose[:2] for estimate in chosen], dtype=np.float64).reshape(-1, 2)
        none = (np.nan,) * 6
        covariance = np.array([estimate.covariance or none for estimate in chosen], dtype=np.float64).reshape(-1, 6)
        finite = np.isfinite(xy).all(axis=1)
        return cls(time_ns[finite], xy[finite], covariance[finite])
