"""A way to nl80211: requests that are answered, and events in between, over anything that carries datagrams.

The kernel's own is a plain netlink socket. pyroute2's is not used: it drains several datagrams at once into a queue of
its own, so that polling its descriptor misses the rest.
"""

from __future__ import annotations

import errno
import os
import socket
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Protocol

from fusion.errors import ProtocolError
from sensors.wifi.nl80211_message import (
    ACK,
    DUMP,
    ERROR,
    HEADER,
    INTERRUPTED,
    REQUEST,
    Attributes,
    Command,
    Message,
    decode,
    encode,
)

ANSWER_S = 2.0
"""The kernel answers while it is asked, or after another's request; a longer silence is its driver's fault."""
TRIES = 3
"""Dumps begun anew because the list changed meanwhile."""
RECEIVE_BUFFER = 1 << 20
GENERIC, SOL_NETLINK = 16, 270
ADD_MEMBERSHIP, CAP_ACK, EXT_ACK = 1, 10, 11
DATAGRAM = 1 << 16


class Transport(Protocol):
    """Carrier of datagrams to nl80211 and back; every method may raise `OSError`."""

    def open(self, groups: Sequence[str]) -> int:
        """Join the multicast groups; the number of the family nl80211. ENOENT: this kernel has no Wi-Fi."""

    def send(self, data: bytes) -> None:
        """One request."""

    def receive(self, timeout_s: float) -> bytes | None:
        """The next datagram, None if none came in time; ENOBUFS when some were lost."""

    def close(self) -> None:
        """Let go; never raises."""


class KernelTransport:
    """This machine's kernel."""

    def __init__(self) -> None:
        self._socket: socket.socket | None = None

    def open(self, groups: Sequence[str]) -> int:
        """Look nl80211 up, then join: whoever joins after triggering a scan may miss its end."""
        self._socket = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, GENERIC)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            for option in (CAP_ACK, EXT_ACK):  # reasons in words, and the number of a ranging request
                self._socket.setsockopt(SOL_NETLINK, option, 1)
            self._socket.bind((0, 0))
            family, known = self._look_up()
            for group in groups:
                self._socket.setsockopt(SOL_NETLINK, ADD_MEMBERSHIP, known[group])
        except Exception:
            self.close()
            raise
        return family

    def _look_up(self) -> tuple[int, dict[str, int]]:
        """The family's number, and those of its multicast groups."""
        from pyroute2.netlink import CTRL_CMD_GETFAMILY, GENL_ID_CTRL, ctrlmsg

        question = ctrlmsg()
        question["cmd"], question["version"] = CTRL_CMD_GETFAMILY, 1
        question["header"].update(type=GENL_ID_CTRL, flags=REQUEST)
        question["attrs"] = [("CTRL_ATTR_FAMILY_NAME", "nl80211")]
        question.encode()
        self.send(bytes(question.data))
        data = self.receive(ANSWER_S) or b""
        if len(data) < HEADER.size or HEADER.unpack_from(data)[1] == ERROR:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
        answer = ctrlmsg(data)
        answer.decode()
        groups = answer.get_attr("CTRL_ATTR_MCAST_GROUPS", [])
        return answer.get_attr("CTRL_ATTR_FAMILY_ID"), {
            group.get_attr("CTRL_ATTR_MCAST_GRP_NAME"): group.get_attr("CTRL_ATTR_MCAST_GRP_ID") for group in groups
        }

    def send(self, data: bytes) -> None:
        """One request."""
        self._open_socket().send(data)

    def receive(self, timeout_s: float) -> bytes | None:
        """The next datagram."""
        opened = self._open_socket()
        opened.settimeout(timeout_s)
        with suppress(TimeoutError, BlockingIOError):
            return opened.recv(DATAGRAM)
        return None

    def close(self) -> None:
        """Let go of the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open_socket(self) -> socket.socket:
        if self._socket is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return self._socket


class Nl80211:
    """Requests and events over one transport; for one thread."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._events: deque[Message] = deque()
        self._family = self._sequence = 0

    def open(self, *groups: str) -> None:
        """Join the events of the multicast ``groups``; raises `OSError`."""
        self._events.clear()
        self._family = self._transport.open(groups)

    def close(self) -> None:
        """Let go."""
        self._transport.close()

    def ask(self, command: Command, attributes: Attributes, *, dump: bool = False) -> list[Message]:
        """The answers to a request; raises `OSError` with the errno of a refusal, `ProtocolError` for nonsense."""
        for _ in range(TRIES):
            answers = self._ask_once(command, attributes, DUMP if dump else ACK)
            if not any(answer.flags & INTERRUPTED for answer in answers):
                break
        return answers

    def _ask_once(self, command: Command, attributes: Attributes, flags: int) -> list[Message]:
        self._sequence += 1
        self._transport.send(encode(Message(command, attributes, self._sequence, REQUEST | flags), self._family))
        answers: list[Message] = []
        while True:
            for message in self._receive(ANSWER_S, silent=errno.ETIMEDOUT):
                if message.sequence != self._sequence:
                    self._keep(message)
                elif message.errno is None:
                    answers.append(message)
                elif message.errno:
                    raise OSError(message.errno, message.attributes.get("MSG") or os.strerror(message.errno))
                else:
                    return [*answers, message] if message.attributes else answers

    def event(self, timeout_s: float) -> Message | None:
        """The next event of the kernel, None if none came in time; raises `ProtocolError`."""
        if not self._events:
            try:
                for message in self._receive(timeout_s):
                    self._keep(message)
            except OSError as error:
                if error.errno != errno.ENOBUFS:
                    raise
                raise ProtocolError("events of nl80211 were lost", "give the sensor's thread more time") from error
        return self._events.popleft() if self._events else None

    def _keep(self, message: Message) -> None:
        if message.errno is None:
            self._events.append(message)

    def _receive(self, timeout_s: float, silent: int = 0) -> list[Message]:
        datagram = self._transport.receive(timeout_s)
        if datagram is None and silent:
            raise OSError(silent, os.strerror(silent))
        return decode(datagram or b"")
