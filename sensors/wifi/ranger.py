"""The ranging loop of one interface: ask all peers, gather their answers, until the kernel reports its end."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from typing import NamedTuple

from fusion.driver import Clock
from fusion.values import nanoseconds, seconds
from sensors.wifi.errors import FIRMWARE, PASSING, refused
from sensors.wifi.ftm import Attempt, read_attempts, request
from sensors.wifi.interface import Interface
from sensors.wifi.loop import LIMIT_NS, Loop, Trouble
from sensors.wifi.nl80211 import Nl80211
from sensors.wifi.nl80211_message import Command, Message
from sensors.wifi.settings import Peer

LATER = PASSING | {errno.EBUSY}


class Round(NamedTuple):
    """The answers to one request, in the order they came; ``done_ns`` when the last had come."""

    attempts: tuple[Attempt, ...]
    done_ns: int


class Ranger(Loop[Round]):
    """Measures to all peers once every ``period_s``."""

    def __init__(
        self, clock: Clock, peers: Sequence[Peer], period_s: float, nl80211: Nl80211, interface: Interface
    ) -> None:
        super().__init__(clock, nl80211, interface)
        self._peers = peers
        self._period_ns = nanoseconds(period_s)
        self._attempts: list[Attempt] = []
        self._deadline_ns: int | None = None  # of the round that runs
        self._cookie: int | None = None

    def _step(self, until_ns: int) -> Round | Trouble | None:
        now_ns = self._clock.now_ns()
        if self._deadline_ns is None and now_ns >= self._due_ns:
            self._begin()
            return None
        if self._deadline_ns is not None and now_ns >= self._deadline_ns:
            return self._failed(f"a round of ranging did not end within {seconds(LIMIT_NS):g} s")
        limit_ns = self._due_ns if self._deadline_ns is None else self._deadline_ns
        event = self._event(min(limit_ns, until_ns))
        return None if event is None else self._heed(event)

    def _begin(self) -> None:
        self._drop()
        now_ns = self._clock.now_ns()
        self._due_ns = now_ns + self._period_ns
        asked = request(self._interface.number, self._peers)
        answers = self._nl80211.ask(Command.PEER_MEASUREMENT_START, asked)
        self._cookie = next((one.attributes["COOKIE"] for one in answers if "COOKIE" in one.attributes), None)
        self._deadline_ns = now_ns + LIMIT_NS

    def _heed(self, event: Message) -> Round | None:
        if self._deadline_ns is None or event.attributes.get("COOKIE") != self._cookie:
            return None  # of a round that was given up
        if event.command == Command.PEER_MEASUREMENT_RESULT:
            self._attempts += read_attempts(event.attributes)
        if event.command != Command.PEER_MEASUREMENT_COMPLETE:
            return None
        measured = Round(tuple(self._attempts), self._clock.now_ns())
        self._drop()
        self._failures = 0
        return measured

    def _refused(self, refusal: OSError) -> Trouble:
        interface, code = self._interface, refusal.errno
        error = refused(refusal, interface.name, "ranging to these peers", interface.driver)
        if code in FIRMWARE:
            return self._failed(error.what)
        if code in LATER:
            return self._later(error.what)
        raise error

    def _drop(self) -> None:
        self._attempts, self._deadline_ns = [], None
