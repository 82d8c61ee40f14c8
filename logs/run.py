"""A run as it comes out of a log: the world it happened in, what was measured, where the robot really was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fusion import Estimate, Measurement, Prior, Remark, Truth, World
from fusion.timeline import Key
from logs.device_messages import ClockSync


@dataclass(frozen=True, slots=True, eq=False)
class TruthTrack:
    """Ground truth as columns of one length n, in time order: time [ns], x, y [m], heading [rad] (NaN: not known)."""

    time_ns: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time_ns)

    def at(self, rows: NDArray[np.bool_]) -> TruthTrack:
        """Some of it, by mask."""
        return TruthTrack(self.time_ns[rows], self.x[rows], self.y[rows], self.heading[rows])

    @classmethod
    def from_truths(cls, truths: Sequence[Truth]) -> TruthTrack:
        """Columns, read-only, from single truths: those with a position; of two at one time the first counts."""
        ordered = sorted((truth for truth in truths if truth.position_known), key=lambda truth: truth.time_ns)
        unique = [truth for i, truth in enumerate(ordered) if i == 0 or truth.time_ns != ordered[i - 1].time_ns]
        time_ns = np.array([truth.time_ns for truth in unique], dtype=np.int64)
        x, y = np.array([t.x for t in unique], dtype=np.float64), np.array([t.y for t in unique], dtype=np.float64)
        heading = np.array([np.nan if t.known_heading is None else t.heading for t in unique], dtype=np.float64)
        for column in (time_ns, x, y, heading):
            column.flags.writeable = False
        return cls(time_ns, x, y, heading)


def left_out(placed: Sequence[bool]) -> list[str]:
    """A sentence that counts the true poses without a position, which no track holds; none where all have one.
    ``placed``: whether each has.
    """
    missing = len(placed) - sum(placed)
    if not missing:
        return []
    if missing == len(placed):
        return [f"none of the {missing} true poses has a position, so there is no ground truth"]
    return [f"{missing} of {len(placed)} true poses have no position, and are left out"]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One recorded run. ``measurements`` stand in the order they arrived; ``lanes`` holds the estimates of estimators
    that were replayed into the log, by name; ``remarks`` are what the devices said that is no measurement, ``clocks``
    how the clocks of the recording computer stood to each other. ``true_stamps``: where a wrong clock stamped a
    measurement, the time a right one would have stamped it with [ns], by `fusion.track.order`; empty but for runs that
    were given that fault.
    """

    path: Path
    name: str
    world: World
    prior: Prior | None
    metadata: Mapping[str, str]
    measurements: tuple[Measurement, ...]
    truth: TruthTrack | None
    warnings: tuple[str, ...]
    lanes: Mapping[str, tuple[Estimate, ...]]
    remarks: tuple[Remark, ...] = ()
    clocks: tuple[ClockSync, ...] = ()
    true_stamps: Mapping[Key, int] = field(default_factory=dict)
