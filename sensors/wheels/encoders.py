"""Wheel encoders on GPIO lines, through the kernel's character device (libgpiod).

A wheel's count is the number of the last edge that the kernel saw on its line, not of those we read: a program that
is held up loses the times of edges and never distance. The kernel numbers anew when the lines are requested again, so
the count so far is kept. A single channel cannot see the direction: commands to the motors are another sensor
(`sensors.wheels.motors`), and the sign is put on by whoever reads the log.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from fusion import (
    Clock,
    DeviceInfo,
    DeviceLostError,
    Diagnostic,
    DriverOutput,
    DriverSpec,
    Found,
    Level,
    Needs,
    SettingError,
)
from fusion.values import WheelTicks, nanoseconds, seconds
from sensors.device_errors import device_error
from sensors.wheels.fake_lines import FakeLines
from sensors.wheels.gpio_lines import GpioLines, Lines

CHIPS = "/dev/gpiochip*"


class Encoders:
    """One encoder a wheel, in the order of the world's robot; ``lines`` are their offsets on the chip."""

    summary: ClassVar[str] = "wheel encoders on GPIO lines, single channel (libgpiod)"

    def __init__(
        self,
        name: str,
        clock: Clock,
        *,
        lines: Sequence[int],
        chip: str = "/dev/gpiochip0",
        hz: float = 20.0,
        debounce_s: float = 0.001,
        device: Callable[[], Lines] = GpioLines,
    ) -> None:
        """``hz``: rate of the reports, also when nothing turns. ``device`` stands in for the chip."""
        if not lines or len(set(lines)) != len(lines) or any(type(line) is not int or line < 0 for line in lines):
            raise SettingError(f"{name}: lines = {list(lines)}", "give the offset of one line for each wheel")
        if not (hz > 0.0 and 0.0 <= debounce_s < 1.0):
            raise SettingError(f"{name}: hz = {hz}, debounce_s = {debounce_s}", "give hz > 0 and 0 <= debounce_s < 1")
        self._name, self._clock, self._device = name, clock, device()
        self._chip, self._lines, self._hz, self._debounce_s = chip, tuple(lines), hz, debounce_s
        self._period_ns = nanoseconds(1.0 / hz)
        self._before = dict.fromkeys(lines, 0)
        """Counts until the lines were requested."""
        self._number = dict.fromkeys(lines, 0)
        """Of the last edge since."""
        self._unseen = 0
        self._due_ns = 0
        self._seq = 0
        self._is_open = False
        self.spec = DriverSpec((WheelTicks,), hz, 0.5 * hz, Needs(groups=("gpio",), modules=("gpiod",)))

    @classmethod
    def discover(cls) -> list[Found]:
        """The GPIO chips."""
        chips = sorted(Path("/").glob(CHIPS.lstrip("/")))
        return [Found(str(chip), "GPIO chip", MappingProxyType({"chip": str(chip)})) for chip in chips]

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeLines]:
        """Two wheels that turn when they are asked to."""
        yield FakeLines()

    def open(self) -> DeviceInfo:
        """Ask for the lines; counting goes on where it was."""
        self.close()
        try:
            self._device.open(self._chip, self._lines, self._debounce_s)
        except ValueError as error:
            raise SettingError(f"{self._name}: {self._chip}: {error}", "`gpioinfo` lists its lines") from error
        except OSError as error:
            raise self._refused(error) from error
        self._is_open = True
        self._opened_ns = self._due_ns = self._clock.now_ns()
        settings = {"chip": self._chip, "lines": self._lines, "hz": self._hz, "debounce_s": self._debounce_s}
        return DeviceInfo(self._device.model, settings=settings)

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """Count edges until the next report is due."""
        if not self._is_open:
            raise DeviceLostError(f"{self._name} is not open", "open the driver first")
        left_s = min(seconds(self._due_ns - self._clock.now_ns()), timeout_s)
        try:
            self._count(max(left_s, 0.0))
            began_ns = self._clock.now_ns()
            if began_ns < self._due_ns:
                return []
            self._count(0.0)  # a program may have been held up since it read: counts and stamp must belong together
        except OSError as error:
            raise DeviceLostError(f"{self._name}: {self._chip} went away ({error})", "plug it in again") from error
        return list(self._report((began_ns + self._clock.now_ns()) // 2))

    def close(self) -> None:
        """Let go of the lines."""
        self._is_open = False
        for line, number in self._number.items():
            self._before[line] += number
        self._number = dict.fromkeys(self._lines, 0)
        self._device.close()

    def _count(self, timeout_s: float) -> None:
        """Take what the kernel has, all of it, once: a line that chatters without end must not hold up the report."""
        if not self._device.wait(timeout_s):
            return
        for edge in self._device.read():
            self._unseen += edge.number - self._number[edge.line] - 1
            self._number[edge.line] = edge.number

    def _report(self, now_ns: int) -> Iterator[DriverOutput]:
        """The counts, true a debouncing time ago: an edge since then may not have been reported yet.

        Reports fall due at whole periods. One that is held up puts off the next, so that none follows within half a
        period: a single tick in next to no time would look like great speed.
        """
        self._due_ns += self._period_ns * ((now_ns - self._due_ns + self._period_ns // 2) // self._period_ns + 1)
        counts = tuple(self._before[line] + self._number[line] for line in self._lines)
        if self._unseen:
            text = f"{self._unseen} edges were counted and not seen one by one: this program was held up"
            yield Diagnostic(now_ns, self._name, Level.WARN, text, (("edges", str(self._unseen)),))
            self._unseen = 0
        self._seq += 1
        yield WheelTicks(max(now_ns - nanoseconds(self._debounce_s), self._opened_ns), self._name, self._seq, counts)

    def _refused(self, error: OSError) -> Exception:
        if error.errno == errno.EINVAL:
            return SettingError(f"{self._name}: {self._chip} has no such lines", "`gpioinfo` lists those it has")
        absent = "`fusion sensors` lists the chips that are there"
        busy = "`gpioinfo` names who has the lines; stop that one"
        return device_error(f"{self._name}: {self._chip}", error, group="gpio", absent=absent, busy=busy)
