"""UWB ranges as plain lines of text: the format for a module whose firmware is your own.

    R,0x1a,3.417          range to an anchor [m]
    R,0x1a,3.417,0.05     and its standard deviation [m]
    R,0x1a,3.417;0x2b,5.02,0.1    several anchors at one time
    F,0x1a,timeout        a ranging that failed, and why
    # anything            is kept as a diagnostic

A line is one message, stamped at its first byte. Anchors go by any name without comma, semicolon or blank.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import ClassVar

from sensors.uwb.fake_serial import FakeSerial, fake_serial
from sensors.uwb.serial_port import Line
from sensors.uwb.serial_ranging import ModuleReport, SerialRanging, sound_range


def parse(text: str) -> ModuleReport:
    """Report in one line.

    >>> parse("R,a,1.5;b,2.5,0.1;c,x").ranges
    (('a', 1.5, None), ('b', 2.5, 0.1))
    >>> parse("F,a,timeout").values
    (('a', 'timeout'),)
    """
    kind, _, rest = text.partition(",")
    if text.startswith("#"):
        return ModuleReport(values=(("text", text[1:].strip()),))
    if kind == "F":
        anchor, _, why = rest.partition(",")
        return ModuleReport(values=((anchor, why or "failed"),))
    if kind != "R":
        return ModuleReport(refused=1)
    found = [_reading(block.split(",")) for block in rest.split(";")]
    ranges = tuple(reading for reading in found if reading is not None)
    return ModuleReport(ranges, refused=len(found) - len(ranges))


def _reading(words: list[str]) -> tuple[str, float, float | None] | None:
    if len(words) not in (2, 3) or not words[0].strip():
        return None
    range_m = sound_range(words[1])
    std_m = sound_range(words[2]) if len(words) == 3 else None
    if range_m is None or (len(words) == 3 and not std_m):
        return None
    return words[0].strip(), range_m, std_m


class UwbLines(SerialRanging):
    """A module that speaks the line format above."""

    summary: ClassVar[str] = "UWB module on a serial port that speaks plain lines (docs/drivers-uwb.md)"
    model: ClassVar[str] = "UWB module, plain lines"

    @classmethod
    def fake(cls) -> AbstractContextManager[FakeSerial]:
        """A module that ranges two anchors."""
        return fake_serial(b"R,a,3.41;b,5.02,0.1\n", b"R,a,\xff\xfe;;\n")

    def _reports(self, line: Line) -> Iterator[tuple[int, ModuleReport]]:
        yield line.time_ns, parse(line.text)
