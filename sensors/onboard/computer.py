"""The robot's own computer: its clocks, its boot, its free disk, its service manager."""

from __future__ import annotations

import ctypes
import os
import shutil
import socket
import time
import uuid
from pathlib import Path

from logs.device_messages import ClockSync

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
NOT_SYNCHRONISED = 5
"""TIME_ERROR, the answer of adjtimex(2) while no service disciplines the clock."""
TIMEX_BYTES = 512
"""More than a struct timex takes on any machine; all zero it only asks."""


def clock_sync() -> ClockSync:
    """The clocks at this moment."""
    boot_ns, monotonic_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME), time.monotonic_ns()
    return ClockSync(boot_ns, monotonic_ns, time.time_ns(), is_clock_synced())


def is_clock_synced() -> bool:
    """Whether a service (NTP, PTP, GPS) keeps the wall clock synchronised, by the state of the kernel."""
    try:
        return ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES)) not in (-1, NOT_SYNCHRONISED)
    except (AttributeError, OSError):
        return False  # no such call on this system: not known to be


def boot_id() -> str:
    """Eight letters that stay the same until the next boot, so that files of two boots never share a name."""
    try:
        return BOOT_ID.read_text()[:8]
    except OSError:
        return uuid.uuid4().hex[:8]


def free_bytes(folder: Path) -> int:
    """Bytes that a plain user may still write where ``folder`` is."""
    return shutil.disk_usage(folder).free


def notify_service_manager(message: str) -> None:
    """Send ``READY=1``, ``WATCHDOG=1`` or ``STOPPING=1`` to systemd, where it started us (sd_notify(3))."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        try:
            link.sendto(message.encode(), address.replace("@", "\0", 1) if address.startswith("@") else address)
        except OSError:
            return  # the manager went away: it will notice by itself, and a recording goes on
