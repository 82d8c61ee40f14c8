"""Fates of the readings of a run, as columns: millions of small values are turned over once, never row by row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion import Decision, Fate, Gyro, MotorCommand, Odometry, Ranges, Reason, Update, WheelTicks, WifiScan
from fusion.arrays import Flags, Floats, Stamps, Whole

Codes = NDArray[np.int16]

DECISIONS, REASONS = tuple(Decision), tuple(Reason)
CODE = {id(member): code for members in (DECISIONS, REASONS) for code, member in enumerate(members)}
"""Their places there. Each is one object, known by its identity: to hash it by name takes longer."""
KINDS = (WifiScan, Ranges, Gyro, WheelTicks, MotorCommand, Odometry)
KIND_CODE = {kind: code for code, kind in enumerate(KINDS)}


def field(rows: Sequence[tuple[Any, ...]], place: int) -> Iterator[Any]:
    """One field of many tuples, without a step of the interpreter for each."""
    return map(itemgetter(place), rows)


class FateColumns(NamedTuple):
    """The last word on every reading, m rows in time order. ``kind`` counts into `KINDS`, ``sensor`` and ``anchor``
    into ``names``, ``decision`` and ``reason`` into `DECISIONS` and `REASONS`. Innovations are NaN where a method
    predicts none.
    """

    time_ns: Stamps
    kind: Codes
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
    def of(cls, updates: Sequence[Update]) -> FateColumns:
        """The columns of the fates of updates in time order."""
        lengths = fates_per_update(updates)
        fates = fates_of(updates)
        kinds = np.fromiter((KIND_CODE[type(update.measurement)] for update in updates), np.int16, len(updates))
        names = sorted({*field(fates, 1), *field(fates, 3)})
        code_of = {name: code for code, name in enumerate(names)}
        sensor, anchor = (np.fromiter(map(code_of.__getitem__, field(fates, i)), np.int16, len(fates)) for i in (1, 3))
        decision, reason = (np.fromiter(map(CODE.__getitem__, map(id, field(fates, i))), np.int16) for i in (4, 5))
        weight, innovation, variance, nis = (np.array(list(field(fates, i)), dtype=np.float64) for i in range(6, 10))
        time_ns = np.fromiter(field(fates, 0), np.int64, len(fates))
        kind, named = np.repeat(kinds, lengths), np.array(names, dtype=np.str_)
        return cls(time_ns, kind, sensor, anchor, decision, reason, weight, innovation, variance, nis, named)

    @property
    def source(self) -> Codes:
        """Name of each reading, counted into ``names``: its anchor, or the sensor of one without an anchor."""
        nameless = np.flatnonzero(self.names == "")
        return np.where(np.isin(self.anchor, nameless), self.sensor, self.anchor)

    def met(self, *members: Decision | Reason) -> Flags:
        """Which readings met one of these decisions, or one of these reasons."""
        codes = [CODE[id(member)] for member in members]
        return np.isin(self.decision if isinstance(members[0], Decision) else self.reason, codes)

    @property
    def counts(self) -> dict[str, int]:
        """Number of readings that met each decision."""
        found = np.bincount(self.decision, minlength=len(DECISIONS))
        return {decision.value: int(count) for decision, count in zip(DECISIONS, found, strict=True)}


def fates_of(updates: Sequence[Update]) -> list[Fate]:
    """The fates behind the rows of `FateColumns`."""
    return [fate for update in updates for fate in update.fates]


def fates_per_update(updates: Sequence[Update]) -> Whole:
    """Number of rows of their `FateColumns` that each of ``updates`` has, (n,)."""
    return np.fromiter((len(update.fates) for update in updates), np.int64, len(updates))
