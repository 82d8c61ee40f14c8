"""Qorvo DW3000 and QM33 modules with the UCI command-line firmware (DWM3001CDK), by their text notifications.

    SESSION_INFO_NTF: {session_handle=1, sequence_number=7, block_index=7, n_measurements=2
     [mac_address=0x0001, status="SUCCESS", distance[cm]=29];
     [mac_address=0x0002, status="RX_TIMEOUT"]}

One notification spans lines, or stands in one, by firmware; it ends where its braces balance. A gap in the numbers of
the sequence counts the lost ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import ClassVar

from sensors.uwb.fake_serial import FakeSerial, fake_serial
from sensors.uwb.serial_port import Line
from sensors.uwb.serial_ranging import ModuleReport, SerialRanging, sound_range

START = "SESSION_INFO_NTF:"
LONGEST = 8192
"""Characters after which a notification that does not end is given up."""
SUCCESS = "SUCCESS"
CENTIMETRE = 0.01


def parse(frame: str) -> ModuleReport:
    """Report in one whole notification; anchors go by the hexadecimal digits of their address, in capitals.

    >>> parse('SESSION_INFO_NTF: {[mac_address=0x1a, status="SUCCESS", distance[cm]=29]; '
    ...       '[mac_address=0x2b, status="RX_TIMEOUT"]}')
    ModuleReport(ranges=(('1A', 0.29, None),), refused=0, values=(('2B', 'RX_TIMEOUT'),))
    """
    ranges: list[tuple[str, float, float | None]] = []
    failures: list[tuple[str, str]] = []
    refused = 0
    for block in frame.split("mac_address=")[1:]:
        address = re.match(r"0x([0-9A-Fa-f]+)", block)
        status = re.search(r'status="(\w+)"', block)
        distance = re.search(r"distance\[cm\]=(-?[\d.]+)", block)
        range_m = sound_range(distance[1], CENTIMETRE) if distance else None
        if address and status and status[1] != SUCCESS:
            failures.append((address[1].upper(), status[1]))
        elif address and status and range_m is not None:
            ranges.append((address[1].upper(), range_m, None))
        else:
            refused += 1
    return ModuleReport(tuple(ranges), refused, tuple(failures))


class Frames:
    """Gathers lines into whole notifications."""

    def __init__(self) -> None:
        self._text = ""
        self._began_ns = 0

    def feed(self, line: Line) -> Iterator[tuple[int, str, bool]]:
        """Time [ns], text, and whether it is whole, of each notification that ends with ``line``, or is given up."""
        pieces = line.text.split(START)
        yield from self._extend(pieces[0])
        for piece in pieces[1:]:
            if self._text:
                yield self._began_ns, self._text, False
            self._text, self._began_ns = START, line.time_ns
            yield from self._extend(piece)

    def _extend(self, piece: str) -> Iterator[tuple[int, str, bool]]:
        if not self._text:
            return  # between notifications: prompts, "ok", answers to commands
        self._text += piece + "\n"
        is_whole = "{" in self._text and self._text.count("{") <= self._text.count("}")
        if is_whole or len(self._text) > LONGEST:
            yield self._began_ns, self._text, is_whole
            self._text = ""


class UwbQm33(SerialRanging):
    """A DWM3001CDK or another module with that firmware; ``start``, as ``INITF -MULTI ...``, begins a session."""

    summary: ClassVar[str] = "DW3000 / QM33 UWB module on USB serial (command-line firmware, as on the DWM3001CDK)"
    model: ClassVar[str] = "QM33 command line"

    @classmethod
    def fake(cls) -> AbstractContextManager[FakeSerial]:
        """A module with two responders, one of which does not answer."""
        frame = b"SESSION_INFO_NTF: {session_handle=1, sequence_number=7, block_index=7, n_measurements=2\r\n"
        frame += b' [mac_address=0x0001, status="SUCCESS", distance[cm]=29];\r\n'
        frame += b' [mac_address=0x0002, status="RX_TIMEOUT"]}\r\n'
        return fake_serial(frame, b'SESSION_INFO_NTF: {[mac_address=0x00zz, status="SUC\r\nSESSION_INFO_NTF: {}\r\n')

    def _begin(self) -> str:
        self._frames = Frames()
        self._sequence: int | None = None
        return super()._begin()

    def _reports(self, line: Line) -> Iterator[tuple[int, ModuleReport]]:
        for time_ns, frame, is_whole in self._frames.feed(line):
            report = parse(frame) if is_whole else ModuleReport(refused=1)
            yield time_ns, report._replace(values=report.values + self._lost(frame))

    def _lost(self, frame: str) -> tuple[tuple[str, str], ...]:
        """Count of lost notifications, by the gap in their numbers."""
        number = re.search(r"sequence_number=(\d+)", frame)
        if number is None:
            return ()
        before, self._sequence = self._sequence, int(number[1])
        gap = 0 if before is None else self._sequence - before - 1
        return (("notifications lost", str(gap)),) if gap > 0 else ()
