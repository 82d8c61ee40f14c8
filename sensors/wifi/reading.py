"""Readings of one scan with their times: from the kernel's list to stamped readings, all pure.

The kernel lists old entries too, so a reading counts only if it was received within the scan's window. mac80211
drivers stamp each frame as it comes. Others hand over everything when the scan ends: then a reading's time is only
known to lie somewhere in the window, and its middle, with a standard deviation of a uniform distribution (window / sqrt
12), is the honest stamp.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from enum import Enum, unique
from typing import NamedTuple

from fusion.values import nanoseconds
from sensors.wifi.nl80211_message import Attributes, Message

SSID_ELEMENT = 0
MILLISECOND_NS = 1_000_000
MARGIN_NS = nanoseconds(0.02)
"""The kernel counts milliseconds in steps of up to ten, and reports another's scan a moment after it began."""
FRAME_STD_NS = nanoseconds(0.001)
"""A frame is stamped in the kernel's receive path; a generous bound, not measured."""
DWELL_NS = nanoseconds(0.01)
"""No radio listens on a channel for less: two channels received within this time were not stamped at reception."""


@unique
class Stamp(Enum):
    """Instant at which a device stamps a frame."""

    FRAME = "frame"
    SCAN_END = "scan_end"


class Window(NamedTuple):
    """A scan's beginning and end [ns]."""

    began_ns: int
    done_ns: int


class ScanEntry(NamedTuple):
    """One access point as the kernel lists it. ``is_exact`` False: its time was counted in milliseconds of age."""

    bssid: str
    ssid: str
    frequency_mhz: int
    rssi_dbm: float
    time_ns: int
    is_exact: bool


class Part(NamedTuple):
    """One scan as the kernel ran it: fresh entries, and the number of others."""

    window: Window
    entries: tuple[ScanEntry, ...]
    refused: int


class Stamped(NamedTuple):
    """One reading with its honest time, and that time's standard deviation."""

    entry: ScanEntry
    time_ns: int
    std_ns: int


def read_entries(listed: Iterable[Message], now_ns: int) -> list[ScanEntry]:
    """The access points of a dump taken at ``now_ns``; those without a strength in dBm are left out."""
    networks = (message.attributes.get("BSS", {}) for message in listed)
    return [_read_one(bss, now_ns) for bss in networks if {"BSSID", "FREQUENCY", "SIGNAL_MBM"} <= bss.keys()]


def _read_one(bss: Attributes, now_ns: int) -> ScanEntry:
    is_exact = "LAST_SEEN_BOOTTIME" in bss
    time_ns = bss["LAST_SEEN_BOOTTIME"] if is_exact else now_ns - bss.get("SEEN_MS_AGO", 0) * MILLISECOND_NS
    ssid = read_ssid(bss.get("INFORMATION_ELEMENTS", b""))
    return ScanEntry(bss["BSSID"].hex(":"), ssid, bss["FREQUENCY"], bss["SIGNAL_MBM"] / 100.0, time_ns, is_exact)


def read_ssid(elements: bytes) -> str:
    """The network's name in a frame's elements (type, length, value); "" where it is hidden or broken off."""
    place = 0
    while place + 2 <= len(elements):
        kind, length = elements[place], elements[place + 1]
        value = elements[place + 2 : place + 2 + length]
        if kind == SSID_ELEMENT:
            return value.decode(errors="replace").strip("\0")
        place += 2 + length
    return ""


def fresh(entries: Iterable[ScanEntry], window: Window, now_ns: int) -> Part:
    """Entries received within the window; a reading from before it is stale, one from the future a broken clock."""
    listed = list(entries)
    kept = tuple(one for one in listed if window.began_ns - MARGIN_NS <= one.time_ns <= now_ns)
    return Part(window, kept, len(listed) - len(kept))


def betrays_end_stamping(part: Part) -> bool:
    """Whether these times cannot be those of the frames: counted ages, or two channels received at once."""
    if any(not one.is_exact for one in part.entries):
        return True
    ordered = sorted(part.entries, key=lambda one: one.time_ns)
    pairs = itertools.pairwise(ordered)
    return any(a.frequency_mhz != b.frequency_mhz and b.time_ns - a.time_ns < DWELL_NS for a, b in pairs)


def stamped(part: Part, stamp: Stamp) -> list[Stamped]:
    """The readings with their times, newest last."""
    if stamp is Stamp.FRAME:
        timed = [Stamped(one, one.time_ns, FRAME_STD_NS) for one in part.entries]
    else:
        length_ns = part.window.done_ns - part.window.began_ns
        middle_ns = part.window.began_ns + length_ns // 2
        timed = [Stamped(one, middle_ns, round(length_ns / math.sqrt(12.0))) for one in part.entries]
    return sorted(timed, key=lambda one: (one.time_ns, one.entry.bssid))
