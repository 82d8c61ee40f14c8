"""The computer and the devices of a recording: its wall clock, descriptions of devices, their complaints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

from fusion import Diagnostic, Level
from fusion.values import nanoseconds, seconds
from logs.device_messages import ClockSync

STEP_NS = nanoseconds(0.05)
"""Least step of the wall clock against the time since boot that is reported; NTP slews by less in ten seconds."""
MOST_COMPLAINTS = 10
STATE, RUNNING = "state", "running"
"""The key of a sensor's state in the diagnostics of its recorder, and its value while all is well."""
OPENED = "opened"
"""The text of the diagnostic by which a recorder keeps the description of an open device."""
STATUS = "status"
"""The text of the diagnostic by which a recorder reports, each second, the state of a sensor."""


def wall_clock(clocks: Sequence[ClockSync], start_ns: int) -> dict[str, Any] | None:
    """The time of day that the log begins at, and the steps of the wall clock in it; None where not known."""
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


def devices(diagnostics: Sequence[Diagnostic]) -> dict[str, dict[str, str]]:
    """The description of each device, by the name of its sensor: its last opening counts."""
    return {diagnostic.sensor: dict(diagnostic.values) for diagnostic in diagnostics if diagnostic.text == OPENED}


def complaints(diagnostics: Sequence[Diagnostic]) -> list[tuple[str, int]]:
    """Warnings and errors of sensors, most frequent first, with their count; the states of each second are left out."""
    bad = (r for r in diagnostics if r.level is not Level.OK and r.text != STATUS)
    return Counter(map(as_line, bad)).most_common(MOST_COMPLAINTS)


def as_line(diagnostic: Diagnostic) -> str:
    """A diagnostic with the name of its sensor, which errors of drivers have already."""
    return (
        diagnostic.text if diagnostic.text.startswith(diagnostic.sensor) else f"{diagnostic.sensor}: {diagnostic.text}"
    )


def is_down(diagnostic: Diagnostic) -> bool:
    """Whether a diagnostic of the recorder states that the sensor does not run: it is lost, or not there yet."""
    return dict(diagnostic.values).get(STATE, RUNNING) != RUNNING


def dropped(diagnostics: Sequence[Diagnostic]) -> dict[str, int]:
    """Messages that a recorder lost because it was too slow, by the name of the sensor that lost any."""
    counts: dict[str, int] = {}
    for diagnostic in diagnostics:
        if diagnostic.text == STATUS:
            counts[diagnostic.sensor] = int(dict(diagnostic.values).get("dropped", "0"))
    return {sensor: count for sensor, count in counts.items() if count}
