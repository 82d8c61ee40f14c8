"""A run as it comes out of a log: the world it happened in, what was measured, where the robot really was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fusion import Diagnostic, Estimate, Measurement, Prior, World
from fusion.timeline import Key
from logs.device_messages import ClockSync
from logs.truth import TruthTrack


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
    that were replayed into the log, by name; ``diagnostics`` come from the devices and are no measurements, ``clocks``
    are the offsets between the clocks of the recording computer. ``true_stamps``: where a wrong clock stamped a
    measurement, the time a right one would have stamped it with [ns], by `fusion.timeline.order`; empty but for runs
    that were given that fault.
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
    diagnostics: tuple[Diagnostic, ...] = ()
    clocks: tuple[ClockSync, ...] = ()
    true_stamps: Mapping[Key, int] = field(default_factory=dict)
