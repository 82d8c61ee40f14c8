"""Base of the scan loop and the ranging loop: small steps over the kernel's events, and an end to hopeless tries.

A loop waits for one thing at a time, never longer than a poll is given, and for nothing longer than a limit. What goes
wrong once is reported and tried again a little later; a radio that fails several times in a row needs a person.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, NamedTuple, TypeVar

from fusion.driver import Clock
from fusion.errors import ProtocolError
from fusion.values import nanoseconds, seconds
from sensors.wifi.errors import stuck
from sensors.wifi.interface import Interface
from sensors.wifi.nl80211 import Nl80211
from sensors.wifi.nl80211_message import Message

LIMIT_NS = nanoseconds(12.0)
"""The firmware of a Raspberry Pi gives a scan up after ten seconds."""
RETRY_NS = nanoseconds(1.0)
FAILURES_TO_STUCK = 3


class Trouble(NamedTuple):
    """A single failure; the loop goes on."""

    text: str


Result = TypeVar("Result")
"""Result of a scan or a round of ranging."""


class Loop(ABC, Generic[Result]):
    """One interface at work; raises `DriverError` where going on makes no sense."""

    def __init__(self, clock: Clock, nl80211: Nl80211, interface: Interface) -> None:
        self._clock, self._nl80211, self._interface = clock, nl80211, interface
        self._due_ns = clock.now_ns()
        self._failures = 0
        self._pending: Result | Trouble | None = None

    def start(self) -> None:
        """Ask for the first result, so that what the kernel refuses shows at once."""
        try:
            self._begin()
        except OSError as error:
            self._pending = self._refused(error)

    def poll(self, timeout_s: float) -> Result | Trouble | None:
        """A result, or what went wrong, if there is one within the time given."""
        until_ns = self._clock.now_ns() + nanoseconds(timeout_s)
        outcome, self._pending = self._pending, None
        while outcome is None:
            try:
                outcome = self._step(until_ns)
            except ProtocolError as error:
                outcome = Trouble(str(error))
            except OSError as error:
                outcome = self._refused(error)
            if self._clock.now_ns() >= until_ns:
                break
        return outcome

    @abstractmethod
    def _begin(self) -> None:
        """Ask the kernel; raises `OSError`."""

    @abstractmethod
    def _step(self, until_ns: int) -> Result | Trouble | None:
        """Begin what is due, or wait for one event, until ``until_ns`` at the latest; raises `OSError`."""

    @abstractmethod
    def _refused(self, refusal: OSError) -> Trouble | None:
        """Heed the kernel's refusal, or raise what the lifecycle or a person must see to."""

    @abstractmethod
    def _drop(self) -> None:
        """Forget what is under way."""

    def _event(self, limit_ns: int) -> Message | None:
        return self._nl80211.event(seconds(max(limit_ns - self._clock.now_ns(), 0)))

    def _later(self, what: str) -> Trouble:
        self._drop()
        self._due_ns = self._clock.now_ns() + RETRY_NS
        return Trouble(what)

    def _failed(self, what: str) -> Trouble:
        self._failures += 1
        if self._failures >= FAILURES_TO_STUCK:
            raise stuck(self._interface.name, self._interface.driver, self._failures, what)
        return self._later(what)
