"""The status of all sensors, for people, in one line."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from sensors.onboard.driver_lifecycle import State
from sensors.onboard.supervisor import Status


def status_line(statuses: Sequence[Status]) -> str:
    """Status of all sensors in one line.

    >>> status_line([Status("gyro", State.RUNNING, 99.96, 0.01, 400, 0, 0, ""),
    ...              Status("wifi", State.BACKOFF, None, 4.2, 12, 3, 1, "wlan0 is down")])
    'gyro 100.0 Hz | wifi backoff 4.2 s ago (3 dropped)'
    """
    parts = []
    for status in statuses:
        age = "" if status.age_s is None else f" {status.age_s:.1f} s ago"
        rate = "waiting" if status.rate_hz is None else f"{status.rate_hz:.1f} Hz"
        dropped = f" ({status.dropped} dropped)" if status.dropped else ""
        doing = rate if status.state is State.RUNNING else status.state.value + age
        parts.append(f"{status.name} {doing}{dropped}")
    return " | ".join(parts)


def totals(statuses: Sequence[Status]) -> list[str]:
    """Counts of each sensor, a line each."""
    return [f"{s.name}: {s.messages} messages, {s.dropped} dropped, lost {s.losses} times" for s in statuses]


class StatusLine:
    """Writes the status line to stderr: over itself on a terminal, once a change of state elsewhere."""

    def __init__(self, *, over_itself: bool | None = None) -> None:
        self._over_itself = sys.stderr.isatty() if over_itself is None else over_itself
        self._last: list[State] = []
        self._is_warned = False

    def write(self, statuses: Sequence[Status], first: str = "", warning: str = "") -> None:
        """Write the status of sensors, after a text that belongs ``first``; a ``warning`` once, on its own line."""
        if warning and not self._is_warned:
            sys.stderr.write(f"\nwarning: {warning}\n")
            self._is_warned = True
        states = [status.state for status in statuses]
        line = " | ".join(filter(None, [first, status_line(statuses)]))
        if self._over_itself:
            sys.stderr.write(f"\r\x1b[K{line}")
            sys.stderr.flush()
        elif states != self._last:
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
        self._last = states
