"""What a recording tells of its own computer and devices: the wall clock, the devices, what they complained of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

from fusion import Level, Remark
from fusion.values import nanoseconds, seconds
from logs.device_messages import ClockSync

STEP_NS = nanoseconds(0.05)
"""Least step of the wall clock against the time since boot that is told; NTP slews by less than this in ten seconds."""
MOST_TOLD = 10
STATE, RUNNING = "state", "running"
"""What remarks on a sensor by its recorder hold, and its value while all is well."""
OPENED = "opened"
"""The text of the remark by which a recorder tells what a device says of itself."""
STATUS = "status"
"""The text of the remark by which a recorder tells, each second, how a sensor does."""


def wall_clock(clocks: Sequence[ClockSync], start_ns: int) -> dict[str, Any] | None:
    """The time of day that the log begins at, and the steps of the wall clock in it; None where nothing tells."""
    if not clocks:
        return None
    ordered = sorted(clocks)
    offsets = [sync.real_ns - sync.boot_ns for sync in ordered]
    steps = [
        {"at_s": seconds(sync.boot_ns - start_ns), "by_s": seconds(after - before)}
        for sync, (before, after) in zip(ordered[1:], pairwise(offsets), strict=True)
        if abs(after - before) >= STEP_NS
    ]
    slept_ns = max(sync.boot_ns - sync.monotonic_ns for sync in ordered)
    slept_ns -= min(sync.boot_ns - sync.monotonic_ns for sync in ordered)
    began = datetime.fromtimestamp(seconds(offsets[-1] + start_ns), UTC)
    return {
        "began": began.isoformat(timespec="seconds"),
        "synced": ordered[-1].ntp_synced,
        "steps": steps,
        "suspended_s": seconds(slept_ns),
    }


def devices(remarks: Sequence[Remark]) -> dict[str, dict[str, str]]:
    """What each device says of itself, by the name of its sensor: its last opening counts."""
    return {remark.sensor: dict(remark.values) for remark in remarks if remark.text == OPENED}


def complaints(remarks: Sequence[Remark]) -> list[tuple[str, int]]:
    """What went wrong with sensors, most frequent first, with its count; the states told each second are left out."""
    bad = (r for r in remarks if r.level is not Level.OK and r.text != STATUS)
    return Counter(map(as_line, bad)).most_common(MOST_TOLD)


def as_line(remark: Remark) -> str:
    """A remark with the name of its sensor, which errors of drivers say by themselves."""
    return remark.text if remark.text.startswith(remark.sensor) else f"{remark.sensor}: {remark.text}"


def is_down(remark: Remark) -> bool:
    """Whether a recorder remarks that the sensor does not run: it is lost, or not there yet."""
    return dict(remark.values).get(STATE, RUNNING) != RUNNING


def dropped(remarks: Sequence[Remark]) -> dict[str, int]:
    """Messages that a recorder lost because it was too slow, by the name of the sensor that lost any."""
    counts: dict[str, int] = {}
    for remark in remarks:
        if remark.text == STATUS:
            counts[remark.sensor] = int(dict(remark.values).get("dropped", "0"))
    return {sensor: count for sensor, count in counts.items() if count}
