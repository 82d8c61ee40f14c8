"""Base of the drivers for UWB modules on a serial port: a port, lines, ranges with the names of anchors.

A reading that cannot be understood costs that reading, a line that cannot be understood that line; both are reported,
and counted. The device's own position and its failures are diagnostics: no estimator sees them, the log keeps them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, NamedTuple

from fusion import (
    Clock,
    DeviceInfo,
    Diagnostic,
    DriverOutput,
    DriverSpec,
    Found,
    Level,
    RangeReading,
    Ranges,
    SettingError,
)
from sensors.uwb.serial_port import NEEDS, Line, LineReader, SerialPort, find_ports

LONGEST_RANGE_M = 1000.0
"""No UWB module reaches farther: a larger number is a number gone wrong."""
NONE: Mapping[str, str] = MappingProxyType({})


class ModuleReport(NamedTuple):
    """Content of one line, or one notification: ranges [m] by the device's own names of anchors."""

    ranges: tuple[tuple[str, float, float | None], ...] = ()
    """Name, range [m], and its standard deviation [m] where the device claims one."""
    refused: int = 0
    """Readings in it that cannot be understood."""
    values: tuple[tuple[str, str], ...] = ()
    """Everything else in it: its own position, failures."""


def sound_range(text: str, unit_m: float = 1.0) -> float | None:
    """A range [m] from its text, None where it is none that can be.

    >>> sound_range("1.25"), sound_range("29", 0.01), sound_range("-1"), sound_range("nan"), sound_range("x")
    (1.25, 0.29, None, None, None)
    """
    try:
        range_m = float(text) * unit_m
    except ValueError:
        return None
    return range_m if math.isfinite(range_m) and 0.0 <= range_m <= LONGEST_RANGE_M else None


class SerialRanging:
    """A UWB module on a serial port; base of a driver for each firmware.

    ``names`` gives a device's name of an anchor the world's; a name that is not in it stays as it is. ``start`` is a
    line sent to the module when it is opened, for a firmware that waits for a command. ``std_m`` stands for the
    standard deviation that the device does not claim.
    """

    summary: ClassVar[str]
    model: ClassVar[str]

    def __init__(
        self,
        name: str,
        clock: Clock,
        *,
        port: str,
        baudrate: int = 115200,
        hz: float = 10.0,
        least_hz: float = 1.0,
        std_m: float | None = None,
        names: Mapping[str, str] = NONE,
        start: str = "",
    ) -> None:
        if not hz >= least_hz > 0.0:
            raise SettingError(f"{name}: hz = {hz}, least_hz = {least_hz}", "give hz >= least_hz > 0")
        if std_m is not None and not std_m > 0.0:
            raise SettingError(f"{name}: std_m = {std_m}", "give a positive standard deviation [m], or leave it out")
        self._name, self._clock = name, clock
        self._port = SerialPort(port, baudrate)
        self._names, self._std_m, self._start = dict(names), std_m, start
        self._lines = LineReader(clock)
        self._seq = 0
        self._overlong = 0
        self.spec = DriverSpec((Ranges,), hz, least_hz, NEEDS)

    @classmethod
    def discover(cls) -> list[Found]:
        """Serial ports on USB: which module is behind one shows when it is opened."""
        return find_ports()

    def open(self) -> DeviceInfo:
        """Open the port and have the module report; leaves the port closed where it does not."""
        self._port.open()
        self._lines = LineReader(self._clock)
        self._overlong = 0
        try:
            firmware = self._begin()
        except BaseException:
            self.close()
            raise
        settings = {"port": self._port.path, "baudrate": self._port.baudrate}
        return DeviceInfo(self.model, firmware=firmware, settings=settings)

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """Ranges and diagnostics of the lines that arrived."""
        lines = self._lines.feed(self._port.read(timeout_s))
        outputs = [output for line in lines for output in self._outputs(line)]
        if self._lines.overlong > self._overlong:
            self._overlong = self._lines.overlong
            outputs.append(self._diagnostic(self._clock.now_ns(), "a line without an end was dropped"))
        return outputs

    def close(self) -> None:
        """Close the port. The module goes on reporting."""
        self._port.close()

    def _begin(self) -> str:
        """Have the module report; its firmware version, "" where it does not report one."""
        if self._start:
            self._port.write(self._start.encode() + b"\r\n")
        return ""

    def _reports(self, line: Line) -> Iterator[tuple[int, ModuleReport]]:
        """Reports of a line, each with the time at which it was true [ns]."""
        raise NotImplementedError

    def _outputs(self, line: Line) -> Iterator[DriverOutput]:
        for time_ns, report in self._reports(line):
            if report.ranges:
                self._seq += 1
                readings = tuple(
                    RangeReading(self._names.get(anchor, anchor), range_m, self._std_m if std_m is None else std_m)
                    for anchor, range_m, std_m in report.ranges
                )
                yield Ranges(time_ns, self._name, self._seq, readings)
            if report.values:
                yield Diagnostic(time_ns, self._name, Level.OK, "reported beside the ranges", report.values)
            if report.refused:
                yield self._diagnostic(time_ns, f"{report.refused} readings cannot be understood", line.text)

    def _diagnostic(self, time_ns: int, text: str, line: str = "") -> Diagnostic:
        return Diagnostic(time_ns, self._name, Level.WARN, text, (("line", line[:200]),) if line else ())
