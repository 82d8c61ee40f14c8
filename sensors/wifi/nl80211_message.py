"""The messages of Linux's nl80211 that our drivers use, as bytes and back.

The codec is pyroute2's; the table of attributes is ours, because pyroute2's leaves those of scans and ranging as hex
text. Numbers are those of include/uapi/linux/nl80211.h. All here is pure; pyroute2 is imported by the first message.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from enum import IntEnum, unique
from functools import cache
from typing import Any, NamedTuple, TypeAlias

from fusion.errors import ProtocolError

Attributes: TypeAlias = dict[str, Any]
"""Values by the kernel's names without their prefix: numbers, bytes, True for a flag, `Attributes`, lists of these."""
Rows: TypeAlias = tuple[tuple[Any, ...], ...]
"""Attributes of one level: number, name, type (pyroute2's, or the rows of a nest), and whether it is a list of them."""

REQUEST, MULTIPART, ACK, INTERRUPTED, DUMP = 0x1, 0x2, 0x4, 0x10, 0x300
"""Flags of a message; a dump that was interrupted is not consistent."""
ACK_CAPPED, ACK_ATTRIBUTES = 0x100, 0x200
"""Flags of an answer's end: of the request only the header is repeated; attributes follow."""
ERROR, DONE, OVERRUN = 2, 3, 4
HEADER = struct.Struct("=IHHII")
ERRNO = struct.Struct("=i")
LEAST_ATTRIBUTE = 4


@unique
class Command(IntEnum):
    """Requests and events."""

    GET_WIPHY = 1
    NEW_WIPHY = 3
    GET_INTERFACE = 5
    NEW_INTERFACE = 7
    GET_SCAN = 32
    TRIGGER_SCAN = 33
    NEW_SCAN_RESULTS = 34
    SCAN_ABORTED = 35
    GET_POWER_SAVE = 62
    PEER_MEASUREMENT_START = 131
    PEER_MEASUREMENT_RESULT = 132
    PEER_MEASUREMENT_COMPLETE = 133


BSS: Rows = (
    (1, "BSSID", "cdata"),
    (2, "FREQUENCY", "uint32"),
    (6, "INFORMATION_ELEMENTS", "cdata"),
    (7, "SIGNAL_MBM", "int32"),
    (10, "SEEN_MS_AGO", "uint32"),
    (15, "LAST_SEEN_BOOTTIME", "uint64"),
)
BAND: Rows = ((1, "FREQS", ((1, "FREQ", "uint32"), (2, "DISABLED", "flag")), True),)
FTM_REQUEST: Rows = (
    (1, "ASAP", "flag"),
    (2, "PREAMBLE", "uint32"),
    (3, "NUM_BURSTS_EXP", "uint8"),
    (6, "FTMS_PER_BURST", "uint8"),
)
FTM_RESPONSE: Rows = (
    (1, "FAIL_REASON", "uint32"),
    (9, "RSSI_AVG", "int32"),
    (13, "RTT_AVG", "int64"),
    (14, "RTT_VARIANCE", "uint64"),
    (16, "DIST_AVG", "int64"),
    (17, "DIST_VARIANCE", "uint64"),
)
FTM_CAPABILITY: Rows = ((1, "ASAP", "flag"), (5, "PREAMBLES", "uint32"), (8, "MAX_FTMS_PER_BURST", "uint8"))
CHANNEL: Rows = (
    (38, "WIPHY_FREQ", "uint32"),
    (159, "CHANNEL_WIDTH", "uint32"),
    (160, "CENTER_FREQ1", "uint32"),
)
PEER: Rows = (
    (1, "ADDR", "cdata"),
    (2, "CHAN", CHANNEL),
    (3, "REQ", ((1, "DATA", ((1, "FTM", FTM_REQUEST),)),)),
    (
        4,
        "RESP",
        (
            (1, "DATA", ((1, "FTM", FTM_RESPONSE),)),
            (2, "STATUS", "uint32"),
            (3, "HOST_TIME", "uint64"),
            (5, "FINAL", "flag"),
        ),
    ),
)
MEASUREMENTS: Rows = (
    (1, "MAX_PEERS", "uint32"),
    (4, "TYPE_CAPA", ((1, "FTM", FTM_CAPABILITY),)),
    (5, "PEERS", PEER, True),
)
MESSAGE: Rows = (
    (1, "WIPHY", "uint32"),
    (2, "WIPHY_NAME", "asciiz"),
    (3, "IFINDEX", "uint32"),
    (4, "IFNAME", "asciiz"),
    (5, "IFTYPE", "uint32"),
    (6, "MAC", "cdata"),
    (22, "WIPHY_BANDS", BAND, True),
    (44, "SCAN_FREQUENCIES", "uint32", True),
    (45, "SCAN_SSIDS", "cdata", True),
    (47, "BSS", BSS),
    (88, "COOKIE", "uint64"),
    (93, "PS_STATE", "uint32"),
    (158, "SCAN_FLAGS", "uint32"),
    (174, "SPLIT_WIPHY_DUMP", "flag"),
    (273, "PEER_MEASUREMENTS", MEASUREMENTS),
)

ACKNOWLEDGEMENT: Rows = ((1, "MSG", "asciiz"), (3, "COOKIE", "uint64"))


class Message(NamedTuple):
    """One message. ``errno``: None but in an answer's end, with 0 or the reason of the refusal."""

    command: int
    attributes: Attributes
    sequence: int = 0
    flags: int = 0
    errno: int | None = None


def encode(message: Message, family: int) -> bytes:
    """The bytes of a message; ``family`` is the number the kernel knows nl80211 by."""
    coded = _codec()()
    coded["cmd"], coded["version"] = int(message.command), 1
    coded["header"].update(type=family, flags=message.flags, sequence_number=message.sequence)
    coded["attrs"] = _from_attributes(message.attributes)["attrs"]
    coded.encode()
    return bytes(coded.data)


def encode_end(errno: int, sequence: int, attributes: Attributes | None = None, *, dump: bool = False) -> bytes:
    """The bytes of an answer's end, as a kernel sends it: MSG in words and COOKIE, if there are any."""
    if dump and errno == 0:
        return HEADER.pack(HEADER.size + ERRNO.size, DONE, MULTIPART, sequence, 0) + ERRNO.pack(0)
    coded = _acknowledgement()()
    coded["error"], coded["request"] = -errno, bytes(HEADER.size)
    coded["header"].update(type=ERROR, flags=ACK_CAPPED | (ACK_ATTRIBUTES if attributes else 0))
    coded["header"]["sequence_number"] = sequence
    coded["attrs"] = _from_attributes(attributes or {})["attrs"]
    coded.encode()
    return bytes(coded.data)


def decode(datagram: bytes) -> list[Message]:
    """The messages of one datagram; raises `ProtocolError` where it is none of nl80211's."""
    messages, place = [], 0
    while place < len(datagram):
        if len(datagram) - place < HEADER.size:
            raise _nonsense(f"{len(datagram) - place} bytes are left over")
        length, kind, flags, sequence, _ = HEADER.unpack_from(datagram, place)
        if not HEADER.size <= length <= len(datagram) - place:
            raise _nonsense(f"a message of {length} bytes in {len(datagram) - place}")
        messages.append(_decode_one(datagram[place : place + length], kind, flags, sequence))
        place += length + -length % LEAST_ATTRIBUTE
    return messages


def _decode_one(data: bytes, kind: int, flags: int, sequence: int) -> Message:
    try:
        if kind == ERROR and flags & ACK_ATTRIBUTES:
            coded = _acknowledgement()(data)
            coded.decode()
            return Message(0, _to_attributes(coded), sequence, flags, -coded["error"])
        if kind in {ERROR, DONE, OVERRUN}:
            errno = -ERRNO.unpack_from(data, HEADER.size)[0] if len(data) > HEADER.size else 0
            return Message(0, {}, sequence, flags, errno)
        coded = _codec()(data)
        coded.decode()
        return Message(coded["cmd"], _to_attributes(coded), sequence, flags)
    except Exception as error:
        raise _nonsense(repr(error)) from error  # pyroute2 fails in many ways on bytes that are no message


def _nonsense(why: str) -> ProtocolError:
    return ProtocolError(
        f"the kernel's nl80211 sent what cannot be read: {why}", "update the kernel's Wi-Fi driver, or report it"
    )


def _to_attributes(coded: Mapping[str, Any]) -> Attributes:
    found: Attributes = {}
    for slot in coded["attrs"]:
        name, cell = slot.cell  # not slot.value: that logs what it cannot decode, and goes on
        if name != "UNKNOWN":
            cell.decode()
            found[name] = _plain(cell.getvalue())
    return found


def _plain(value: object) -> object:
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return _to_attributes(value) if isinstance(value, dict) else value


def _from_attributes(attributes: Attributes) -> dict[str, Any]:
    return {"attrs": [(name, _coded_value(value)) for name, value in attributes.items() if value is not False]}


def _coded_value(value: object) -> object:
    if isinstance(value, list):
        return [_coded_value(one) for one in value]
    return _from_attributes(value) if isinstance(value, dict) else value


@cache
def _codec() -> type[Any]:
    """pyroute2's class for a whole message."""
    from pyroute2.netlink import genlmsg

    return _level(genlmsg, MESSAGE)


@cache
def _acknowledgement() -> type[Any]:
    """The class for an answer's end; pyroute2's own does not know where its attributes begin."""
    from pyroute2.netlink import nlmsg

    fields = (("error", "i"), ("request", f"{HEADER.size}s"))
    return type("Acknowledgement", (_level(nlmsg, ACKNOWLEDGEMENT),), {"fields": fields})


def _level(base: type[Any], rows: Rows) -> type[Any]:
    """pyroute2's class for one level of attributes."""
    from pyroute2.netlink import NLA_F_NESTED, nla, nlmsg_atoms

    members: dict[str, Any] = {}
    table = []
    for number, name, kind, *repeated in rows:
        nested = not isinstance(kind, str)
        members[name] = _bounded(_level(nla, kind) if nested else getattr(nlmsg_atoms, kind))
        flags = NLA_F_NESTED if nested or repeated else 0
        table.append((number, name, f"*{name}" if repeated else name, flags))
    return type("Level", (base,), {**members, "nla_map": tuple(table)})


def _bounded(base: type[Any]) -> type[Any]:
    """The class, refusing a length shorter than its own header: on one of 0, pyroute2 reads a list for ever."""

    def decode(self: Any) -> None:  # noqa: ANN401 - of the class made here
        base.decode(self)
        if self.length < LEAST_ATTRIBUTE:
            raise ValueError(f"an attribute of {self.length} bytes")

    return type("Bounded", (base,), {"decode": decode})
