"""Fine timing measurement, Wi-Fi's round-trip time, in nl80211: requests and answers; pure.

A range is c/2 times the round-trip time. Time is in picoseconds, distance in millimetres, both signed: a near peer may
come out behind the antenna, and stays so here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from enum import IntEnum, unique
from typing import NamedTuple

from sensors.wifi.nl80211_message import Attributes
from sensors.wifi.settings import Peer

LIGHT_M_PER_PS = 299_792_458.0 / 1e12
WIDTHS = {20: 1, 40: 2, 80: 3}
"""NL80211_CHAN_WIDTH_* by bandwidth [MHz]."""
HT, VHT = 1, 2
PREAMBLES = {20: HT, 40: HT, 80: VHT}


@unique
class Status(IntEnum):
    """Status of an attempt: nl80211_peer_measurement_status."""

    SUCCESS = 0
    REFUSED = 1
    TIMEOUT = 2
    FAILURE = 3


class Attempt(NamedTuple):
    """One peer's answer. ``range_m``, ``std_m`` and ``rssi_dbm`` are None where the device reports none; ``time_ns``
    is the host's boot time of the answer, None where it is not reported.
    """

    bssid: str
    status: Status
    range_m: float | None
    std_m: float | None
    rssi_dbm: float | None
    time_ns: int | None
    fail_reason: int | None = None


def request(index: int, peers: Sequence[Peer]) -> Attributes:
    """One request to measure to every peer, as soon as possible, on the interface ``index``."""
    return {"IFINDEX": index, "PEER_MEASUREMENTS": {"PEERS": [_asked(peer) for peer in peers]}}


def _asked(peer: Peer) -> Attributes:
    channel = {"WIPHY_FREQ": peer.frequency_mhz, "CHANNEL_WIDTH": WIDTHS[peer.bandwidth_mhz]}
    if peer.center_mhz:
        channel["CENTER_FREQ1"] = peer.center_mhz
    how = {
        "ASAP": True,
        "PREAMBLE": PREAMBLES[peer.bandwidth_mhz],
        "NUM_BURSTS_EXP": peer.bursts_exponent,
        "FTMS_PER_BURST": peer.frames_per_burst,
    }
    return {"ADDR": bytes.fromhex(peer.bssid.replace(":", "")), "CHAN": channel, "REQ": {"DATA": {"FTM": how}}}


def read_attempts(result: Attributes) -> list[Attempt]:
    """The answers in one result; one without an address or a status is left out."""
    peers: Iterable[Attributes] = result.get("PEER_MEASUREMENTS", {}).get("PEERS", ())
    return [
        _read_one(peer["ADDR"], peer["RESP"]) for peer in peers if "STATUS" in peer.get("RESP", {}) and "ADDR" in peer
    ]


def _read_one(address: bytes, response: Attributes) -> Attempt:
    measured = response.get("DATA", {}).get("FTM", {})
    status = response["STATUS"]
    rssi = measured.get("RSSI_AVG")
    return Attempt(
        address.hex(":"),
        Status(status) if status in set(Status) else Status.FAILURE,
        _range_m(measured),
        _std_m(measured),
        None if rssi is None else rssi / 100.0,
        response.get("HOST_TIME") or None,
        measured.get("FAIL_REASON"),
    )


def _range_m(measured: Attributes) -> float | None:
    """The device's own distance, calibrated perhaps; else from the round trip."""
    if "DIST_AVG" in measured:
        return float(measured["DIST_AVG"]) / 1000.0
    return 0.5 * LIGHT_M_PER_PS * measured["RTT_AVG"] if "RTT_AVG" in measured else None


def _std_m(measured: Attributes) -> float | None:
    """From the variance of the round trip, or of the distance; a variance of zero claims nothing."""
    if measured.get("RTT_VARIANCE"):
        return 0.5 * LIGHT_M_PER_PS * math.sqrt(measured["RTT_VARIANCE"])
    return math.sqrt(measured["DIST_VARIANCE"]) / 1000.0 if measured.get("DIST_VARIANCE") else None
