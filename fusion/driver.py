"""The contract every driver keeps: four methods around one device, and what can be known of it without the device.

A driver is a class built as ``Class(name, clock, **settings)``; building one touches no device. It never reconnects by
itself, never sleeps longer than it is asked to, never repeats an old value: whoever runs it
(`sensors.onboard.driver_lifecycle`) owns retries, watchdog and threads. Parsing is pure functions of bytes, apart from
the driver. `docs/drivers.md` shows how.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Mapping, Sequence
from enum import Enum, unique
from types import MappingProxyType
from typing import ClassVar, NamedTuple, Protocol, TypeAlias, runtime_checkable

from fusion.values import Measurement, Truth, nanoseconds


class Needs(NamedTuple):
    """Requirements before the device opens; `fusion doctor` checks each and prints its cure."""

    capabilities: tuple[str, ...] = ()
    """Linux capabilities, as ``CAP_NET_ADMIN``."""
    groups: tuple[str, ...] = ()
    """Groups of the user, as ``gpio``."""
    modules: tuple[str, ...] = ()
    """Python packages to import; all come with the extra ``sensors`` where ours need them."""


class DriverSpec(NamedTuple):
    """Output of a driver, by its settings; readable without hardware.

    ``least_hz`` is the rate [Hz] below which the sensor counts as silent: the watchdog waits for three periods of it,
    a second at least. Zero: it speaks only when something happens, and no silence is too long.
    """

    kinds: tuple[type[Measurement | Truth], ...]
    nominal_hz: float
    least_hz: float
    needs: Needs = Needs()


class Found(NamedTuple):
    """A device that is there: a name that stays the same over reboots, and the settings that open it."""

    id: str
    about: str
    settings: Mapping[str, object]


class DeviceInfo(NamedTuple):
    """Description that an open device gives of itself; ``settings`` as read back from it, not as asked for."""

    model: str
    serial: str = ""
    firmware: str = ""
    settings: Mapping[str, object] = MappingProxyType({})


class Advice(NamedTuple):
    """One thing that `fusion doctor` looked at: how it stands, and what to do if it should be otherwise.

    A driver may offer ``advise()``, which answers a list of them and neither opens nor changes its device.
    """

    is_well: bool
    what: str
    cure: str = ""

    def __str__(self) -> str:
        """One sentence, as that of an error."""
        return f"{self.what}; {self.cure}" if self.cure else self.what


@unique
class Level(Enum):
    """Severity of a diagnostic; the values are those of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


class Diagnostic(NamedTuple):
    """A report of a device that is no measurement: an aborted scan, a failed ranging, its own position, a temperature.

    Kept in the log; no estimator sees it. ``values`` are names with numbers or words.
    """

    time_ns: int
    sensor: str
    level: Level
    text: str
    values: tuple[tuple[str, str], ...] = ()


DriverOutput: TypeAlias = Measurement | Truth | Diagnostic
"""One item from a poll. Only a simulated robot knows the `Truth`."""


@runtime_checkable
class Clock(Hashable, Protocol):
    """A source of time: CLOCK_BOOTTIME on a robot, a virtual one in a test."""

    def now_ns(self) -> int:
        """Nanoseconds since boot, never backwards."""

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""


class BootClock:
    """The kernel's CLOCK_BOOTTIME, which no one sets and which goes on through a suspend."""

    def now_ns(self) -> int:
        """Nanoseconds since boot."""
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""
        time.sleep(max(duration_s, 0.0))


class VirtualClock:
    """A clock that stands until somebody sleeps: hours of waiting pass in no time, the same each time."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """Nanoseconds since its start."""
        return self._now_ns

    def sleep(self, duration_s: float) -> None:
        """Let time pass, at once."""
        self._now_ns += nanoseconds(max(duration_s, 0.0))


@runtime_checkable
class Driver(Protocol):
    """One device. All methods are called from one thread; errors are leaves of `fusion.errors.DriverError`."""

    summary: ClassVar[str]
    """One line: what device it drives, for lists."""
    spec: DriverSpec

    @classmethod
    def discover(cls) -> list[Found]:
        """Devices of this kind that are there now; an empty list, never an error, where none can be."""

    def open(self) -> DeviceInfo:
        """All or nothing: afterwards the device is running with its settings read back, or all is as before and a
        `DriverError` states why. Closed drivers may be opened again.
        """

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """Output that arrived, waiting at most about ``timeout_s``; empty when none did. A reading that cannot be
        understood costs that reading alone and is reported as a `Diagnostic`. Raises `DeviceLostError` when the device
        is gone.
        """

    def close(self) -> None:
        """Let go of the device. Legal in any state, any number of times; never raises."""


class FakeDevice(Protocol):
    """A stand-in for a driver's device, shipped beside it: the conformance kit and users without hardware play on it.

    A driver offers one by a class method ``fake()`` that answers a context manager of it.
    """

    settings: Mapping[str, object]
    """Settings of the driver with which it opens this device."""
    clock: Clock
    """The clock to build it with."""

    def speak(self) -> None:
        """Let the device send one whole message: at least one measurement comes out of the next polls."""

    def garble(self) -> None:
        """Let it send bytes that cannot be understood."""

    def unplug(self) -> None:
        """Take it away."""

    def plug(self) -> None:
        """Give it back."""
