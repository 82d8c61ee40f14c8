"""Messages about the devices of a recording: their diagnostics, and the offsets between the clocks of its computer.

Kept apart from `logs.messages`: no estimator sees any of them.
"""

from __future__ import annotations

from typing import NamedTuple

from fusion import Diagnostic, Level
from logs.cdr import Unpacker
from logs.messages import stamped, take_header

DIAGNOSTICS = ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
CLOCKS = ("/clock_sync", "fusion_msgs/msg/ClockSync")


class ClockSync(NamedTuple):
    """The clocks of one computer at one moment [ns]. The stamps of its log count from boot: this dates it."""

    boot_ns: int
    monotonic_ns: int
    real_ns: int
    ntp_synced: bool


def encode_diagnostic(diagnostic: Diagnostic) -> bytes:
    """A diagnostic as an array of one status."""
    message = stamped(diagnostic.time_ns, diagnostic.sensor).put("I", 1).put("b", diagnostic.level.value)
    message.text(diagnostic.sensor).text(diagnostic.text).text("").put("I", len(diagnostic.values))
    for key, value in diagnostic.values:
        message.text(key).text(value)
    return message.message()


def decode_diagnostic(data: bytes) -> Diagnostic:
    """A diagnostic from its message."""
    cursor = Unpacker(data)
    time_ns, _ = take_header(cursor)
    if (count := cursor.whole()) != 1:
        raise ValueError(f"an array of {count} statuses is none of ours")
    level, sensor, text = Level(min(cursor.whole("b"), Level.ERROR.value)), cursor.text(), cursor.text()
    cursor.text()
    return Diagnostic(
        time_ns, sensor, level, text, tuple((cursor.text(), cursor.text()) for _ in range(cursor.whole()))
    )


def encode_clock(sync: ClockSync) -> bytes:
    """The clocks of a moment."""
    message = stamped(sync.boot_ns, "clock").put("q", sync.boot_ns, sync.monotonic_ns, sync.real_ns)
    return message.put("?", sync.ntp_synced).message()


def decode_clock(data: bytes) -> ClockSync:
    """The clocks of a moment from their message."""
    cursor = Unpacker(data)
    take_header(cursor)
    boot_ns, monotonic_ns, real_ns = (cursor.whole("q") for _ in range(3))
    return ClockSync(boot_ns, monotonic_ns, real_ns, bool(cursor.whole("?")))
