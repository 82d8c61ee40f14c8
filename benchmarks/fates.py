"""What became of every reading of a lane, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.instants import Floats, Stamps
from fusion import Decision, Fate, Reason, Update

MEMBERS = (*Decision, *Reason)
CODE = {member: code for code, member in enumerate(MEMBERS)}
"""Decisions and reasons as numbers."""

Codes = NDArray[np.int64]
Flags = NDArray[np.bool_]


class FateColumns(NamedTuple):
    """The fates of a lane in time order, all (n,). ``update``: the index of their update in ``Lane.final``; ``name``:
    the anchor, or the sensor of a reading without one; ``nis``: NaN where there is none.
    """

    fate: list[Fate]
    update: Codes
    time_ns: Stamps
    name: NDArray[np.str_]
    decision: Codes
    reason: Codes
    weight: Floats
    nis: Floats

    def of(self, *members: Decision | Reason) -> Flags:
        """Which fates have one of these decisions, or one of these reasons."""
        codes = [CODE[member] for member in members]
        column = self.decision if isinstance(members[0], Decision) else self.reason
        return np.isin(column, codes)


def fate_columns(updates: Sequence[Update]) -> FateColumns:
    """The columns of all fates of ``updates``."""
    counts = np.fromiter((len(update.fates) for update in updates), np.int64, len(updates))
    fates: list[Fate] = list(chain.from_iterable(update.fates for update in updates))
    rows: list[tuple[object, ...]] = list(zip(*fates, strict=True)) or [()] * len(Fate._fields)
    column = dict(zip(Fate._fields, rows, strict=True))
    return FateColumns(
        fates,
        np.repeat(np.arange(len(updates)), counts),
        np.array(column["time_ns"], dtype=np.int64),
        np.array([fate.anchor or fate.sensor for fate in fates], dtype=np.str_),
        np.array([CODE[fate.decision] for fate in fates], dtype=np.int64),
        np.array([CODE[fate.reason] for fate in fates], dtype=np.int64),
        np.array(column["weight"], dtype=np.float64),
        np.array(column["nis"], dtype=np.float64),
    )
