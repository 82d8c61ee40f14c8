"""What a lane said, as columns: millions of small values are turned into arrays once, never row by row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.track import Floats, Stamps
from benchmarks.review.canvas import thinned
from fusion import Decision, Fate, Reason, Update

MEMBERS = (*Decision, *Reason)
CODE = {id(member): code for code, member in enumerate(MEMBERS)}
"""Decisions and reasons as numbers. Each is one object, told by its identity: to hash it by name takes longer."""

Codes = NDArray[np.int64]
Flags = NDArray[np.bool_]


def _field(rows: Sequence[tuple[Any, ...]], place: int) -> Iterator[Any]:
    """One field of many tuples, without a step of the interpreter for each."""
    return map(itemgetter(place), rows)


class DrawnFates(NamedTuple):
    """The ``fates`` of a lane in time order, all (n,). ``update``: the index of their update in ``Lane.final``;
    ``name``: the anchor, or the sensor of a reading without one; ``nis``: NaN where there is none.
    """

    fates: list[Fate]
    update: Codes
    time_ns: Stamps
    name: NDArray[np.str_]
    decision: Codes
    reason: Codes
    weight: Floats
    nis: Floats

    @classmethod
    def of_updates(cls, updates: Sequence[Update]) -> DrawnFates:
        """The fates of ``updates``, which stand in time order."""
        by_update = [update.fates for update in updates]
        fates = list(chain.from_iterable(by_update))
        time_ns, sensor, _, anchor, decision, reason, weight, _, _, nis = (_field(fates, i) for i in range(10))
        return cls(
            fates,
            np.repeat(np.arange(len(updates)), list(map(len, by_update))),
            np.fromiter(time_ns, np.int64, len(fates)),
            np.array([a or s for a, s in zip(anchor, sensor, strict=True)], dtype=np.str_),
            np.fromiter(map(CODE.__getitem__, map(id, decision)), np.int64, len(fates)),
            np.fromiter(map(CODE.__getitem__, map(id, reason)), np.int64, len(fates)),
            np.fromiter(weight, np.float64, len(fates)),
            np.array(list(nis), dtype=np.float64),
        )

    def of(self, *members: Decision | Reason) -> Flags:
        """Which fates have one of these decisions, or one of these reasons."""
        codes = [CODE[id(member)] for member in members]
        return np.isin(self.decision if isinstance(members[0], Decision) else self.reason, codes)


class EstimateColumns(NamedTuple):
    """The estimates of a lane in time order, all (n,): what they claim of themselves."""

    time_ns: Stamps
    valid: Flags
    p_lost: Floats
    reset_count: Codes

    @classmethod
    def of_updates(cls, updates: Sequence[Update]) -> EstimateColumns:
        """The estimates of ``updates``; ``p_lost`` is NaN where a method has no opinion."""
        said = [update.estimate for update in updates]
        time_ns, _, _, valid, _, p_lost, reset_count, _ = (_field(said, i) for i in range(8))
        return cls(
            np.fromiter(time_ns, np.int64, len(said)),
            np.fromiter(valid, np.bool_, len(said)),
            np.array(list(p_lost), dtype=np.float64),
            np.fromiter(reset_count, np.int64, len(said)),
        )


class DrawnTrack(NamedTuple):
    """The valid positions of a lane, thinned: all (n,); ``covariance`` (n, 6) of (x, y, heading) row by row above the
    diagonal [m², m rad, rad²], NaN where none is claimed.
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
