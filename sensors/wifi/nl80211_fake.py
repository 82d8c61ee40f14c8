"""A kernel that is not there: it answers nl80211's requests byte for byte, on a virtual clock.

Ships beside the drivers, for tests and for users without a radio. It stands where the netlink socket stands, so the
real encoder, parser and scan loop run on it. It refuses what a kernel refuses, in a kernel's order.
"""

from __future__ import annotations

import errno
import heapq
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from fusion.driver import Clock, VirtualClock
from fusion.values import nanoseconds, seconds
from sensors.wifi.nl80211_message import DUMP, MULTIPART, Attributes, Command, Message, decode, encode, encode_end

FAMILY = 28
INTERFACE, INDEX, WIPHY = "wlan0", 3, 0
MAC = bytes((2, 0, 0, 0, 0, 0))
FLUSH = 2
CHANNELS_MHZ = (*range(2412, 2473, 5), 5180, 5200)
BURST_NS = nanoseconds(0.03)
TIMED_OUT = 2
"""Status of a ranging request without an answer."""
LIGHT_M_PER_S = 299_792_458.0
NONSENSE = b"\x18\x00\x00\x00\x1c\x00\x00\x00 this is no message"


@dataclass
class AccessPoint:
    """One anchor as it is received. ``range_m`` None: it answers no ranging request."""

    ssid: str
    frequency_mhz: int
    rssi_dbm: float
    range_m: float | None = None
    range_std_m: float = 0.1


def three_access_points() -> dict[str, AccessPoint]:
    """On channels 1, 6 and 11."""
    return {
        "02:00:00:00:01:00": AccessPoint("ap1", 2412, -23.0, 1.414),
        "02:00:00:00:02:00": AccessPoint("ap2", 2437, -36.0, 5.099),
        "02:00:00:00:03:00": AccessPoint("ap3", 2462, -34.0, 4.472),
    }


@dataclass
class FakeKernel:
    """One radio with one interface. What is set here holds from the next request or scan on."""

    clock: VirtualClock = field(default_factory=VirtualClock)
    access_points: dict[str, AccessPoint] = field(default_factory=three_access_points)
    is_there: bool = True
    refusals: dict[Command, int] = field(default_factory=dict)
    """An errno for a command; 0 lifts it."""
    end: Command | None = Command.NEW_SCAN_RESULTS
    """Event that ends scans; None: never."""
    dwell_s: float = 0.1
    """Time on one channel."""
    stamps_at_end: bool = False
    counts_age: bool = False
    """No boot time with a reading, only milliseconds of age."""
    ranges: bool = True
    """Whether the radio measures ranges at all."""
    most_frames: int = 31
    """Frames per burst it allows."""
    asked: list[Message] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._waiting: list[tuple[int, int, bytes]] = []
        self._count = 0
        self._busy_until_ns = 0
        self._cache: dict[str, tuple[AccessPoint, int]] = {}

    # -- the transport

    def open(self, groups: Sequence[str]) -> int:  # noqa: ARG002 - every group is joined
        """As a socket that is opened: earlier events are not received."""
        self._waiting = [one for one in self._waiting if one[0] > self.clock.now_ns()]
        heapq.heapify(self._waiting)
        return FAMILY

    def send(self, data: bytes) -> None:
        """Heed requests."""
        for message in decode(data):
            self.asked.append(message)
            self._serve(message)

    def receive(self, timeout_s: float) -> bytes | None:
        """The next datagram that is due within the time; the clock moves there."""
        until_ns = self.clock.now_ns() + nanoseconds(timeout_s)
        due_ns = max(self._waiting[0][0], self.clock.now_ns()) if self._waiting else until_ns + 1
        self.clock.sleep(seconds(min(due_ns, until_ns) - self.clock.now_ns()))
        return heapq.heappop(self._waiting)[2] if due_ns <= until_ns else None

    def close(self) -> None:
        """Nothing to let go of."""

    # -- what happens by itself

    def scan_by_another(
        self, frequencies_mhz: Sequence[int] = CHANNELS_MHZ, index: int = INDEX, *, is_seen: bool = True
    ) -> None:
        """Another program scans, without flushing; ``is_seen`` False: its beginning was before anybody joined."""
        self._scan(frequencies_mhz, index, is_seen=is_seen)

    def emit(self, data: bytes) -> None:
        """Send these bytes at once."""
        self._schedule(data, self.clock.now_ns())

    def unplug(self) -> None:
        """The interface is gone, and its pending events."""
        self.is_there = False
        self._waiting.clear()
        self._busy_until_ns = 0

    # -- answering

    def _serve(self, message: Message) -> None:
        serve: dict[int, Callable[[Message], list[Attributes]]] = {
            Command.GET_INTERFACE: self._interfaces,
            Command.GET_WIPHY: self._wiphys,
            Command.GET_POWER_SAVE: lambda _: [{"PS_STATE": 1}],
            Command.TRIGGER_SCAN: self._trigger,
            Command.GET_SCAN: lambda _: self._listed(),
            Command.PEER_MEASUREMENT_START: self._measure,
        }
        is_dump = message.flags & DUMP == DUMP
        try:
            self._check(message)
            answers = serve[message.command](message)
        except OSError as error:
            self.emit(encode_end(error.errno or 0, message.sequence, {"MSG": error.strerror}))
            return
        end = answers.pop() if answers and "COOKIE" in answers[-1] else None
        for answer in answers:
            command = ANSWERS.get(Command(message.command), message.command)
            self.emit(encode(Message(command, answer, message.sequence, MULTIPART), FAMILY))
        self.emit(encode_end(0, message.sequence, end, dump=is_dump))

    def _check(self, message: Message) -> None:
        if message.attributes.get("IFINDEX", INDEX) != INDEX or (not self.is_there and "IFINDEX" in message.attributes):
            raise _refusal(errno.ENODEV)
        if self.refusals.get(Command(message.command)):
            raise _refusal(self.refusals[Command(message.command)])

    def _interfaces(self, _: Message) -> list[Attributes]:
        one: Attributes = {"IFNAME": INTERFACE, "IFINDEX": INDEX, "WIPHY": WIPHY, "MAC": MAC}
        return [one] if self.is_there else []

    def _wiphys(self, _: Message) -> list[Attributes]:
        bands = [{"FREQS": [{"FREQ": frequency}]} for frequency in CHANNELS_MHZ]
        ranging = {
            "MAX_PEERS": 8,
            "TYPE_CAPA": {"FTM": {"ASAP": True, "PREAMBLES": 7, "MAX_FTMS_PER_BURST": self.most_frames}},
        }
        radio: Attributes = {"WIPHY": WIPHY, "WIPHY_BANDS": bands}
        return [radio, {"WIPHY": WIPHY, "PEER_MEASUREMENTS": ranging}] if self.ranges else [radio]

    # -- scanning

    def _trigger(self, message: Message) -> list[Attributes]:
        frequencies = message.attributes["SCAN_FREQUENCIES"]
        if self.clock.now_ns() < self._busy_until_ns:
            raise _refusal(errno.EBUSY)
        if not set(frequencies) <= set(CHANNELS_MHZ):
            raise _refusal(errno.EINVAL)
        if message.attributes.get("SCAN_FLAGS", 0) & FLUSH and self.end is Command.NEW_SCAN_RESULTS:
            self._cache.clear()
        self._scan(frequencies, INDEX)
        return []

    def _scan(self, frequencies_mhz: Sequence[int], index: int, *, is_seen: bool = True) -> None:
        began_ns = self.clock.now_ns()
        dwell_ns = nanoseconds(self.dwell_s)
        done_ns = began_ns + dwell_ns * len(frequencies_mhz)
        about: Attributes = {"WIPHY": WIPHY, "IFINDEX": index}
        if is_seen:
            self._schedule(encode(Message(Command.TRIGGER_SCAN, about), FAMILY), began_ns)
        if self.end is None:
            self._busy_until_ns = 1 << 62
            return
        self._busy_until_ns = done_ns
        self._schedule(encode(Message(self.end, about), FAMILY), done_ns)
        for place, frequency in enumerate(frequencies_mhz):
            seen_ns = done_ns if self.stamps_at_end else began_ns + dwell_ns * place + dwell_ns // 2
            received = {
                k: (replace(ap), seen_ns) for k, ap in self.access_points.items() if ap.frequency_mhz == frequency
            }
            self._cache.update(received)

    def _listed(self) -> list[Attributes]:
        now_ns = self.clock.now_ns()
        listed = {bssid: entry for bssid, entry in self._cache.items() if entry[1] <= now_ns}
        return [{"IFINDEX": INDEX, "BSS": self._bss(bssid, *entry)} for bssid, entry in listed.items()]

    def _bss(self, bssid: str, ap: AccessPoint, seen_ns: int) -> Attributes:
        name = ap.ssid.encode()
        age_ms = (self.clock.now_ns() - seen_ns) // 1_000_000
        return {
            "BSSID": bytes.fromhex(bssid.replace(":", "")),
            "FREQUENCY": ap.frequency_mhz,
            "INFORMATION_ELEMENTS": bytes((0, len(name))) + name,
            "SIGNAL_MBM": round(100.0 * ap.rssi_dbm),
            "SEEN_MS_AGO": age_ms,
            **({} if self.counts_age else {"LAST_SEEN_BOOTTIME": seen_ns}),
        }

    # -- ranging

    def _measure(self, message: Message) -> list[Attributes]:
        at_ns = self.clock.now_ns()
        about: Attributes = {"WIPHY": WIPHY, "IFINDEX": INDEX, "COOKIE": message.sequence}
        for peer in message.attributes["PEER_MEASUREMENTS"]["PEERS"]:
            at_ns += BURST_NS
            result: Attributes = {"PEER_MEASUREMENTS": {"PEERS": [self._range(peer["ADDR"], at_ns)]}}
            self._schedule(encode(Message(Command.PEER_MEASUREMENT_RESULT, about | result), FAMILY), at_ns)
        if self.end is not None:
            self._schedule(encode(Message(Command.PEER_MEASUREMENT_COMPLETE, about), FAMILY), at_ns)
        return [{"COOKIE": message.sequence}]

    def _range(self, address: bytes, at_ns: int) -> Attributes:
        ap = self.access_points.get(address.hex(":"))
        if ap is None or ap.range_m is None:
            return {"ADDR": address, "RESP": {"STATUS": TIMED_OUT, "HOST_TIME": at_ns, "FINAL": True}}
        there_and_back = 2.0e12 / LIGHT_M_PER_S
        measured = {
            "RSSI_AVG": round(100.0 * ap.rssi_dbm),
            "RTT_AVG": round(ap.range_m * there_and_back),
            "RTT_VARIANCE": round((ap.range_std_m * there_and_back) ** 2),
            "DIST_AVG": round(1000.0 * ap.range_m),
        }
        return {
            "ADDR": address,
            "RESP": {"DATA": {"FTM": measured}, "STATUS": 0, "HOST_TIME": at_ns, "FINAL": True},
        }

    def _schedule(self, data: bytes, due_ns: int) -> None:
        self._count += 1
        heapq.heappush(self._waiting, (due_ns, self._count, data))


ANSWERS = {
    Command.GET_INTERFACE: Command.NEW_INTERFACE,
    Command.GET_WIPHY: Command.NEW_WIPHY,
    Command.GET_SCAN: Command.NEW_SCAN_RESULTS,
}


def _refusal(code: int) -> OSError:
    return OSError(code, os.strerror(code))


class FakeWifi:
    """The `fusion.driver.FakeDevice` of both Wi-Fi drivers."""

    def __init__(self, settings: Mapping[str, object] = MappingProxyType({})) -> None:
        self.kernel = FakeKernel()
        self.clock: Clock = self.kernel.clock
        self.settings: Mapping[str, object] = MappingProxyType({"device": self.kernel, **settings})

    def speak(self) -> None:
        """Nothing to do: the access points always send."""

    def garble(self) -> None:
        """Send bytes that cannot be parsed."""
        self.kernel.emit(NONSENSE)

    def unplug(self) -> None:
        """Take it away."""
        self.kernel.unplug()

    def plug(self) -> None:
        """Give it back."""
        self.kernel.is_there = True
