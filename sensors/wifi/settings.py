"""Settings of the Wi-Fi drivers, checked before any device is touched."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from fusion.errors import SettingError, WorldError, did_you_mean
from fusion.schema import read_record

MODES = {
    "passive": "only listen for beacons",
    "active": "also ask for answers",
    "listen": "trigger nothing, use the scans of others; needs no rights",
}
STAMPS = {"auto": "find out", "frame": "a time for every frame", "scan_end": "one time for all, at the scan's end"}
WIDTHS_MHZ = (20, 40, 80)
USUAL_MHZ = (2412, 2437, 2462)
"""Channels 1, 6 and 11, the three that do not overlap."""
BAND_MHZ = range(2000, 8000)
LONGEST_PERIOD_S = 60.0
LONGEST_INTERFACE = 15
BSSID = re.compile(r"[0-9a-f]{2}(:[0-9a-f]{2}){5}")
ADDRESS_HINT = "six pairs of hex digits with colons, as 02:00:00:00:01:00; `iw dev wlan0 scan` lists them"

Record = TypeVar("Record")


@dataclass(frozen=True)
class WifiSettings:
    """Settings of the driver `wifi`."""

    interface: str
    frequencies_mhz: Sequence[int]
    """The channels of the anchors; fewer channels, shorter scans."""
    names: Mapping[str, str]
    """Anchor by BSSID; one without a name goes by its BSSID."""
    only_named: bool
    mode: str
    per_channel: bool
    """A scan of its own for each channel: a reading's time is known to one dwell where the device stamps at the end."""
    or_listen: bool
    """Where starting scans is not permitted, use those of others instead of failing."""
    period_s: float
    """From the start of one scan to that of the next, at least."""
    stamp: str


@dataclass(frozen=True)
class Peer:
    """An anchor that answers ranging requests, and how it is to be asked."""

    bssid: str
    frequency_mhz: int
    name: str = ""
    bandwidth_mhz: int = 20
    center_mhz: int = 0
    """Middle of a channel wider than 20 MHz."""
    frames_per_burst: int = 4
    bursts_exponent: int = 0
    """Two to this power bursts."""

    @property
    def anchor(self) -> str:
        """Name of the anchor."""
        return self.name or self.bssid


@dataclass(frozen=True)
class RttSettings:
    """Settings of the driver `wifi_rtt`."""

    peers: Sequence[Peer]
    interface: str
    period_s: float


def read_wifi_settings(name: str, given: Mapping[str, object]) -> WifiSettings:
    """Settings of the `wifi` sensor ``name``; raises `SettingError` with the nearest that is known."""
    settings = _read(WifiSettings, name, given)
    _require_one_of(name, "mode", settings.mode, MODES)
    _require_one_of(name, "stamp", settings.stamp, STAMPS)
    _require_common(name, settings.interface, settings.period_s)
    frequencies = tuple(settings.frequencies_mhz)
    for at, frequency in enumerate(frequencies):
        _require_frequency(f"{name}.frequencies_mhz[{at}]", frequency)
    if settings.mode != "listen" and not frequencies:
        raise SettingError(f"{name}.frequencies_mhz is empty", "name the channels of your access points in MHz")
    if len(set(frequencies)) != len(frequencies):
        raise SettingError(f"{name}.frequencies_mhz names a channel twice: {frequencies}", "name each once")
    for bssid in settings.names:
        _require_bssid(f"{name}.names", bssid)
    if settings.only_named and not settings.names:
        raise SettingError(f"{name}.only_named keeps nothing without names", 'give names = {"02:…" = "anchor"}')
    return settings


def read_rtt_settings(name: str, given: Mapping[str, object]) -> RttSettings:
    """Settings of the `wifi_rtt` sensor ``name``; raises `SettingError`."""
    settings = _read(RttSettings, name, given)
    _require_common(name, settings.interface, settings.period_s)
    if not settings.peers:
        raise SettingError(f"{name}.peers is empty", "name each access point's bssid and frequency_mhz")
    for at, peer in enumerate(settings.peers):
        _require_peer(f"{name}.peers[{at}]", peer)
    if len({peer.bssid for peer in settings.peers}) != len(settings.peers):
        raise SettingError(f"{name}.peers names a bssid twice", "name each once")
    return settings


def _read(record: type[Record], name: str, given: Mapping[str, object]) -> Record:
    try:
        return read_record(record, given, name)
    except WorldError as error:
        raise SettingError(str(error), "docs/drivers-wifi.md lists the settings") from error


def _require_common(name: str, interface: str, period_s: float) -> None:
    if not 0 < len(interface) <= LONGEST_INTERFACE or "/" in interface or any(c.isspace() for c in interface):
        raise SettingError(f"{name}.interface: {interface!r} is no interface", "`iw dev` lists them, as wlan0")
    if not 0.0 <= period_s <= LONGEST_PERIOD_S:
        raise SettingError(f"{name}.period_s is {period_s:g}", f"give 0 to {LONGEST_PERIOD_S:g} s")


def _require_peer(where: str, peer: Peer) -> None:
    _require_bssid(f"{where}.bssid", peer.bssid)
    _require_frequency(f"{where}.frequency_mhz", peer.frequency_mhz)
    if peer.bandwidth_mhz not in WIDTHS_MHZ:
        raise SettingError(f"{where}.bandwidth_mhz is {peer.bandwidth_mhz}", f"give one of {WIDTHS_MHZ}")
    if peer.bandwidth_mhz > WIDTHS_MHZ[0]:
        _require_frequency(f"{where}.center_mhz", peer.center_mhz)
    if not 1 <= peer.frames_per_burst <= 31:
        raise SettingError(f"{where}.frames_per_burst is {peer.frames_per_burst}", "give 1 to 31")
    if not 0 <= peer.bursts_exponent <= 14:
        raise SettingError(f"{where}.bursts_exponent is {peer.bursts_exponent}", "give 0 to 14")


def _require_one_of(name: str, setting: str, value: str, known: Mapping[str, str]) -> None:
    if value not in known:
        raise SettingError(f"{name}.{setting}: {value!r} is unknown", did_you_mean(value, known))


def _require_frequency(where: str, frequency_mhz: int) -> None:
    if frequency_mhz not in BAND_MHZ:
        raise SettingError(f"{where} is {frequency_mhz}", "give a channel's MHz: channel 1 is 2412, 36 is 5180")


def _require_bssid(where: str, bssid: str) -> None:
    if not BSSID.fullmatch(bssid):
        near = f"did you mean {bssid.lower()!r}?" if BSSID.fullmatch(bssid.lower()) else ADDRESS_HINT
        raise SettingError(f"{where}: {bssid!r} is no BSSID", near)
