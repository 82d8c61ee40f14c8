"""The scan loop of one interface.

    IDLE ──trigger──→ ASKED ──event of its beginning──→ SCANNING ──its end──→ IDLE
      └───EBUSY────→ FOREIGN ──────────────── its end ─────────────────────────────→ IDLE
    LISTENING: for ever, where we trigger nothing.

An end counts only after its beginning, so the end of somebody's earlier scan is never taken for ours. While another's
scan runs we do not ask again: we wait for its end and use its entries.
"""

from __future__ import annotations

import errno
from enum import Enum, unique
from typing import NamedTuple

from fusion.driver import Clock
from fusion.values import nanoseconds, seconds
from sensors.wifi.errors import FIRMWARE, PASSING, refused
from sensors.wifi.interface import Interface
from sensors.wifi.loop import LIMIT_NS, Loop, Trouble
from sensors.wifi.nl80211 import Nl80211
from sensors.wifi.nl80211_message import Command, Message
from sensors.wifi.reading import Part, Window, fresh, read_entries

GIVEN_UP_NS = nanoseconds(9.0)
"""A scan that is aborted so late was given up by the firmware's own watchdog."""
FLUSH = 2
ANY_SSID = b""
ENDS = (Command.NEW_SCAN_RESULTS, Command.SCAN_ABORTED)


@unique
class Phase(Enum):
    """State of the radio, as far as known."""

    IDLE = "idle"
    ASKED = "asked"
    SCANNING = "scanning"
    FOREIGN = "foreign"
    LISTENING = "listening"


class Plan(NamedTuple):
    """Plan of the scans: one round is a scan of each group of channels in turn, rounds begin ``period_ns`` apart."""

    groups: tuple[tuple[int, ...], ...]
    is_active: bool
    listens: bool
    or_listen: bool
    period_ns: int


class Scan(NamedTuple):
    """A round that was completed, or one scan of somebody else's."""

    parts: tuple[Part, ...]
    is_ours: bool


class Scanner(Loop[Scan]):
    """Scans by a plan, on an interface whose events are joined. ``listens`` may become true on the way."""

    def __init__(self, clock: Clock, plan: Plan, nl80211: Nl80211, interface: Interface) -> None:
        super().__init__(clock, nl80211, interface)
        self.listens = plan.listens
        self._plan = plan
        self._phase = self._rest()
        self._parts: list[Part] = []
        self._began_ns: int | None = None  # of the scan that runs, if its beginning was seen
        self._last_ns = self._due_ns
        self._deadline_ns = 0

    def _rest(self) -> Phase:
        return Phase.LISTENING if self.listens else Phase.IDLE

    def _step(self, until_ns: int) -> Scan | Trouble | None:
        now_ns = self._clock.now_ns()
        if self._phase is Phase.IDLE and now_ns >= self._due_ns:
            self._begin()
            return None
        if self._phase in (Phase.IDLE, Phase.LISTENING):
            limit_ns = until_ns if self.listens else self._due_ns
        else:
            limit_ns = self._deadline_ns
            if now_ns >= limit_ns:
                return self._silent()
        event = self._event(min(limit_ns, until_ns))
        return None if event is None else self._heed(event)

    def _begin(self) -> None:
        if self.listens:
            return
        while (event := self._nl80211.event(0.0)) is not None:
            self._heed(event)  # what came before is no answer to what is asked now
        now_ns = self._clock.now_ns()
        if not self._parts:
            self._due_ns = now_ns + self._plan.period_ns
        asked = {
            "IFINDEX": self._interface.number,
            "SCAN_FREQUENCIES": list(self._frequencies()),
            "SCAN_FLAGS": FLUSH,  # without it the kernel lists what was switched off half a minute ago
        }
        self._nl80211.ask(Command.TRIGGER_SCAN, asked | ({"SCAN_SSIDS": [ANY_SSID]} if self._plan.is_active else {}))
        self._enter(Phase.ASKED)
        self._began_ns = now_ns

    def _frequencies(self) -> tuple[int, ...]:
        return self._plan.groups[len(self._parts)]

    def _enter(self, phase: Phase) -> None:
        self._phase = phase
        self._deadline_ns = self._clock.now_ns() + LIMIT_NS

    def _refused(self, refusal: OSError) -> Trouble | None:
        interface, code = self._interface, refusal.errno
        error = refused(refusal, interface.name, f"a scan of {self._frequencies()} MHz", interface.driver)
        if code == errno.EBUSY:
            self._enter(Phase.FOREIGN)
            return None
        if code == errno.EPERM and self._plan.or_listen:
            self.listens, self._phase = True, Phase.LISTENING
            return Trouble(f"{error.what}; listening to the scans of others")
        if code in FIRMWARE:
            return self._failed(error.what)
        if code in PASSING:
            return self._later(error.what)
        raise error

    def _heed(self, event: Message) -> Scan | Trouble | None:
        if event.attributes.get("IFINDEX") != self._interface.number:
            self._heed_other(event)
        elif event.command == Command.TRIGGER_SCAN:
            self._heed_beginning()
        elif event.command in ENDS and self._phase is not Phase.ASKED:
            return self._ended(is_aborted=event.command == Command.SCAN_ABORTED)
        return None

    def _heed_beginning(self) -> None:
        if self._phase is Phase.ASKED:
            self._phase = Phase.SCANNING  # its time is that of our request, a little earlier
        elif self._phase is not Phase.SCANNING:
            self._began_ns = self._clock.now_ns()

    def _heed_other(self, event: Message) -> None:
        """Another interface of the same radio kept it busy: its end frees the radio, its list is not ours."""
        frees = event.command in ENDS and event.attributes.get("WIPHY") == self._interface.wiphy
        if frees and self._phase is Phase.FOREIGN:
            self._phase, self._due_ns = Phase.IDLE, self._clock.now_ns()

    def _ended(self, *, is_aborted: bool) -> Scan | Trouble | None:
        now_ns, phase = self._clock.now_ns(), self._phase
        window = Window(self._last_ns if self._began_ns is None else self._began_ns, now_ns)
        self._began_ns, self._last_ns = None, now_ns
        if phase is Phase.IDLE:
            return None  # somebody's scan between two of ours
        if is_aborted:
            return self._aborted(now_ns - window.began_ns, phase)
        self._phase, self._failures = self._rest(), 0
        listed = self._nl80211.ask(Command.GET_SCAN, {"IFINDEX": self._interface.number}, dump=True)
        now_ns = self._clock.now_ns()
        part = fresh(read_entries(listed, now_ns), window, now_ns)
        return self._scanned(part) if phase is Phase.SCANNING else Scan((part,), is_ours=False)

    def _aborted(self, took_ns: int, phase: Phase) -> Trouble:
        """The kernel does not flush for a scan that is aborted: nothing of its list can be trusted."""
        what = f"a scan was aborted after {seconds(took_ns):.1f} s; its readings are not used"
        given_up = phase is Phase.SCANNING and took_ns >= GIVEN_UP_NS
        return self._failed(what) if given_up else self._later(what)

    def _scanned(self, part: Part) -> Scan | None:
        self._parts.append(part)
        if len(self._parts) < len(self._plan.groups):
            self._due_ns = self._clock.now_ns()
            return None
        parts, self._parts = tuple(self._parts), []
        self._due_ns = parts[0].window.began_ns + self._plan.period_ns
        return Scan(parts, is_ours=True)

    def _silent(self) -> Trouble:
        """No end within the limit."""
        if self._phase is Phase.FOREIGN and not self._failures:
            raise refused(OSError(errno.EBUSY, ""), self._interface.name, "a scan")
        return self._failed(f"a scan did not end within {seconds(LIMIT_NS):g} s")

    def _drop(self) -> None:
        self._parts.clear()
        self._phase = self._rest()
