"""Generic netlink by hand: what the kernel is told and what it answers, byte for byte.

Written on the standard library alone, on purpose: the drivers under test speak through other libraries, so a mistake of
theirs is not repeated here. A message is nlmsghdr (length, type, flags, sequence, port), genlmsghdr (command, version)
and attributes (length, type, payload, padded to 4 bytes); all in the machine's byte order.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
from collections.abc import Iterator
from typing import NamedTuple

REQUEST, ACK, DUMP = 0x1, 0x4, 0x300
ERROR, DONE = 2, 3
NESTED, TYPE_MASK = 0x8000, 0x3FFF
GENERIC = 16
SOL_NETLINK, ADD_MEMBERSHIP = 270, 1
CONTROLLER, GET_FAMILY = 16, 3
FAMILY_ID, FAMILY_NAME, GROUPS, GROUP_NAME, GROUP_ID = 1, 2, 7, 1, 2

Attributes = dict[int, bytes]


class Message(NamedTuple):
    """One answer or event: nlmsghdr's `kind` and `sequence`, genlmsghdr's `command`, and the attributes' bytes."""

    kind: int
    sequence: int
    command: int
    payload: bytes


def attribute(kind: int, payload: bytes = b"") -> bytes:
    """One attribute; without a payload, a flag."""
    return struct.pack("=HH", 4 + len(payload), kind) + payload + bytes(-len(payload) % 4)


def nest(kind: int, *attributes: bytes) -> bytes:
    """An attribute made of attributes."""
    return attribute(kind | NESTED, b"".join(attributes))


def u8(kind: int, value: int) -> bytes:
    """An attribute of one byte."""
    return attribute(kind, struct.pack("=B", value))


def u32(kind: int, value: int) -> bytes:
    """An attribute of four bytes; negative values in two's complement."""
    return attribute(kind, struct.pack("=I", value & 0xFFFFFFFF))


def u64(kind: int, value: int) -> bytes:
    """An attribute of eight bytes; negative values in two's complement."""
    return attribute(kind, struct.pack("=Q", value & 0xFFFFFFFFFFFFFFFF))


def integer(payload: bytes, *, signed: bool = False) -> int:
    """The number in a payload of any width."""
    return int.from_bytes(payload, sys.byteorder, signed=signed)


def each(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The attributes of `data` in order, repeated ones too."""
    place = 0
    while place + 4 <= len(data):
        length, kind = struct.unpack_from("=HH", data, place)
        yield kind & TYPE_MASK, data[place + 4 : place + length]
        place += (length + 3) & ~3


def attributes(data: bytes) -> Attributes:
    """The attributes of `data` by type."""
    return dict(each(data))


def messages(datagram: bytes) -> Iterator[Message]:
    """The messages of one datagram."""
    place = 0
    while place + 16 <= len(datagram):
        length, kind, _, sequence, _ = struct.unpack_from("=IHHII", datagram, place)
        body = datagram[place + 16 : place + length]
        if kind in (ERROR, DONE):
            yield Message(kind, sequence, 0, body)
        else:
            yield Message(kind, sequence, body[0], body[4:])
        place += (length + 3) & ~3


class Family:
    """A socket that speaks one family of generic netlink, such as nl80211."""

    def __init__(self, name: str) -> None:
        self.socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, GENERIC)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 23)
        self.socket.bind((0, 0))
        self._sequence = 0
        about = self._ask(CONTROLLER, GET_FAMILY, attribute(FAMILY_NAME, name.encode() + b"\0"))
        self.id = integer(about[FAMILY_ID])
        self._groups = {
            group[GROUP_NAME].rstrip(b"\0").decode(): integer(group[GROUP_ID])
            for group in (attributes(data) for _, data in each(about.get(GROUPS, b"")))
        }

    def __enter__(self) -> Family:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def join(self, group: str) -> None:
        """Hear the events of a multicast group from now on."""
        self.socket.setsockopt(SOL_NETLINK, ADD_MEMBERSHIP, self._groups[group])

    def send(self, command: int, *parts: bytes, flags: int = REQUEST, kind: int = 0) -> int:
        """Send one message; its sequence number."""
        self._sequence += 1
        body = struct.pack("=BBH", command, 1, 0) + b"".join(parts)
        head = struct.pack("=IHHII", 16 + len(body), kind or self.id, flags, self._sequence, 0)
        self.socket.send(head + body)
        return self._sequence

    def receive(self, timeout_s: float | None = None) -> list[Message]:
        """The messages of the next datagram; `TimeoutError` if none comes in time."""
        self.socket.settimeout(timeout_s)
        return list(messages(self.socket.recv(1 << 16)))

    def command(self, command: int, *parts: bytes) -> int:
        """Send and wait for the acknowledgement: 0, or the number that a kernel says in its place.

        Raises the `OSError` of the kernel's errno.
        """
        sequence = self.send(command, *parts, flags=REQUEST | ACK)
        while True:
            for message in self.receive(30.0):
                if message.sequence == sequence and message.kind == ERROR:
                    return _checked(message)

    def dump(self, command: int, *parts: bytes) -> list[Attributes]:
        """All objects that the kernel lists."""
        sequence = self.send(command, *parts, flags=REQUEST | DUMP)
        found: list[Attributes] = []
        while True:
            for message in self.receive(30.0):
                if message.sequence != sequence:
                    continue
                if message.kind in (ERROR, DONE):
                    _checked(message)
                    return found
                found.append(attributes(message.payload))

    def _ask(self, kind: int, command: int, *parts: bytes) -> Attributes:
        sequence = self.send(command, *parts, kind=kind)
        (answer,) = [message for message in self.receive(30.0) if message.sequence == sequence]
        if answer.kind == ERROR:
            _checked(answer)
        return attributes(answer.payload)


def _checked(message: Message) -> int:
    answer = integer(message.payload[:4], signed=True) if message.payload else 0
    if answer < 0:
        raise OSError(-answer, os.strerror(-answer))
    return answer
