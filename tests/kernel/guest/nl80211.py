"""Scans by the plainest means: the messages of Linux's nl80211, sent and read by hand."""

from __future__ import annotations

import socket
import time
from typing import NamedTuple

from kernel.guest.netlink import Attributes, Family, attributes, integer, nest, u32

GET_SCAN, TRIGGER_SCAN, NEW_SCAN_RESULTS, SCAN_ABORTED, ABORT_SCAN = 32, 33, 34, 35, 114
IFINDEX, SCAN_FREQUENCIES, BSS, SCAN_FLAGS = 3, 44, 47, 158
BSSID, FREQUENCY, ELEMENTS, SIGNAL_MBM, LAST_SEEN_BOOTTIME = 1, 2, 6, 7, 15
FLUSH = 2


class Reading(NamedTuple):
    """One access point of a scan: power in 1/100 dBm, and when it was heard (CLOCK_BOOTTIME)."""

    bssid: str
    ssid: str
    frequency_mhz: int
    signal_mbm: int
    heard_ns: int


class Scanner:
    """One wireless interface, given by name or, for one that does not exist, by index."""

    def __init__(self, interface: str | int) -> None:
        index = socket.if_nametoindex(interface) if isinstance(interface, str) else interface
        self._interface = u32(IFINDEX, index)
        self._commands, self._events = Family("nl80211"), Family("nl80211")
        self._index = index
        self._events.join("scan")

    def trigger(self, frequencies_mhz: tuple[int, ...], *, flush: bool = True) -> None:
        """Start a passive scan; raises the kernel's `OSError`."""
        wanted = nest(SCAN_FREQUENCIES, *(u32(place, value) for place, value in enumerate(frequencies_mhz)))
        flags = (u32(SCAN_FLAGS, FLUSH),) if flush else ()
        self._commands.command(TRIGGER_SCAN, self._interface, wanted, *flags)

    def abort(self) -> None:
        """Stop the scan that runs; raises the kernel's `OSError`."""
        self._commands.command(ABORT_SCAN, self._interface)

    def wait(self, limit_s: float = 60.0) -> int:
        """The event that ends a scan of this interface: NEW_SCAN_RESULTS or SCAN_ABORTED."""
        deadline = time.monotonic() + limit_s
        while True:
            for message in self._events.receive(max(0.01, deadline - time.monotonic())):
                about = attributes(message.payload)
                if message.command in (NEW_SCAN_RESULTS, SCAN_ABORTED) and integer(about[IFINDEX]) == self._index:
                    return message.command

    def readings(self) -> list[Reading]:
        """All that the kernel remembers, sorted by address."""
        return sorted(_reading(attributes(found[BSS])) for found in self._commands.dump(GET_SCAN, self._interface))

    def scan(self, frequencies_mhz: tuple[int, ...], *, flush: bool = True) -> list[Reading]:
        """Trigger, wait, read."""
        self.trigger(frequencies_mhz, flush=flush)
        if self.wait() == SCAN_ABORTED:
            raise InterruptedError("the scan was aborted")
        return self.readings()


def _reading(bss: Attributes) -> Reading:
    elements = {bss[ELEMENTS][0]: bss[ELEMENTS][2 : 2 + bss[ELEMENTS][1]]}  # the SSID comes first in a beacon
    return Reading(
        bss[BSSID].hex(":"),
        elements.get(0, b"").decode(),
        integer(bss[FREQUENCY]),
        integer(bss[SIGNAL_MBM], signed=True),
        integer(bss[LAST_SEEN_BOOTTIME]),
    )
