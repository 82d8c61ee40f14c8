"""Ranges by Wi-Fi's fine timing measurement, asked of nl80211 by hand."""

from __future__ import annotations

import socket
from typing import NamedTuple

from kernel.guest.netlink import ERROR, Attributes, Family, attribute, attributes, each, integer, nest, u8, u32

START, RESULT, COMPLETE = 131, 132, 133
IFINDEX, FREQUENCY, CHANNEL_WIDTH, PEER_MEASUREMENTS = 3, 38, 159, 273
PEERS, ADDRESS, CHANNEL, REQUEST, RESPONSE = 5, 1, 2, 3, 4
DATA, STATUS, FTM = 1, 2, 1
ASAP, PREAMBLE, FTMS_PER_BURST = 1, 2, 6
RSSI_MBM, ROUND_TRIP_PS, DISTANCE_MM = 9, 13, 16
WIDTH_20, PREAMBLE_HT = 1, 1


class Range(NamedTuple):
    """One peer's answer; the last three are None unless `status` is 0 (1 refused, 2 timeout, 3 failure)."""

    bssid: str
    status: int
    distance_mm: int | None
    round_trip_ps: int | None
    rssi_mbm: int | None


def measure(interface: str, peers: dict[bytes, int], limit_s: float = 60.0) -> list[Range]:
    """Measure to each peer, an address and its frequency in MHz, in one request; sorted by address."""
    with Family("nl80211") as nl80211:
        asked = nest(PEER_MEASUREMENTS, nest(PEERS, *(_ask(*peer, place) for place, peer in enumerate(peers.items()))))
        nl80211.send(START, u32(IFINDEX, socket.if_nametoindex(interface)), asked, flags=1)
        ranges: list[Range] = []
        while True:
            for message in nl80211.receive(limit_s):
                if message.kind == ERROR:
                    code = -integer(message.payload[:4], signed=True)
                    raise OSError(code, "nl80211 refused to measure")
                if message.command == COMPLETE:
                    return sorted(ranges)
                if message.command == RESULT:
                    measured = attributes(attributes(message.payload)[PEER_MEASUREMENTS])
                    ranges += [_range(attributes(peer)) for _, peer in each(measured[PEERS])]


def _ask(address: bytes, frequency_mhz: int, place: int) -> bytes:
    how = nest(FTM, attribute(ASAP), u32(PREAMBLE, PREAMBLE_HT), u8(FTMS_PER_BURST, 4))
    channel = nest(CHANNEL, u32(FREQUENCY, frequency_mhz), u32(CHANNEL_WIDTH, WIDTH_20))
    return nest(place, attribute(ADDRESS, address), channel, nest(REQUEST, nest(DATA, how)))


def _range(peer: Attributes) -> Range:
    response = attributes(peer[RESPONSE])
    measured = attributes(attributes(response.get(DATA, b"")).get(FTM, b""))
    numbers = (
        integer(measured[kind], signed=True) if kind in measured else None
        for kind in (DISTANCE_MM, ROUND_TRIP_PS, RSSI_MBM)
    )
    return Range(peer[ADDRESS].hex(":"), integer(response[STATUS]), *numbers)
