"""Qorvo DWM1001 with PANS firmware, by its UART shell (DWM1001 Firmware API guide: "UART shell mode").

The module wakes up in a binary mode and answers text with the three bytes 40 01 xx; two carriage returns within a
second open the shell. ``lec`` switches CSV lines on, and off again when they were on: hence a look before it is sent.
Lines are spliced at high rates, so they are read by tokens: a block counts where it is whole.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import ClassVar

from fusion import ProtocolError
from sensors.uwb.fake_serial import FakeSerial, fake_serial
from sensors.uwb.serial_port import Line
from sensors.uwb.serial_ranging import ModuleReport, SerialRanging, sound_range

BINARY_ANSWER = b"\x40\x01"
PROMPT = b"dwm>"
LISTEN_S, ANSWER_S = 0.5, 3.0
"""Time to wait for reports, and for an answer: a module at rest reports every tenth of a second."""
TRIES = 3
ANCHOR, ID, DECIMAL = re.compile(r"AN\d"), re.compile(r"[0-9A-Fa-f]{4}"), re.compile(r"-?\d+\.\d+")
SHORT = re.compile(r"([0-9A-Fa-f]{4})\[(-?\d+\.\d+),(-?\d+\.\d+),(-?\d+\.\d+)\]=(\d+\.\d+)")
"""One anchor in the form of ``les``."""
FLOWING = re.compile(rb"DIST,|POS,|[0-9A-Fa-f]{4}\[")


def parse(text: str) -> ModuleReport:
    """Report in a line of ``lec``, ``lep`` or ``les``; the names of anchors are their four hexadecimal digits.

    >>> parse("DIST,2,AN0,0A1B,0.00,0.00,0.00,1.25,AN1,15BA,0.00,0,AN1,15BA,1.00,0.00,0.00,2.50").ranges
    (('0A1B', 1.25, None), ('15BA', 2.5, None))
    >>> parse("0A1B[0.00,0.00,0.00]=1.25 le_us=2345 est[1.00,2.00,0.10,77]").values[-1]
    ('position', '1.00,2.00,0.10,77')
    """
    tokens = text.split(",")
    if tokens[0] not in ("DIST", "POS"):
        return _short(text)
    starts = [i for i, token in enumerate(tokens) if ANCHOR.fullmatch(token)]
    blocks = [tokens[i + 1 : i + 6] for i in starts]
    whole = [block for block in blocks if _is_whole(block)]
    ranges = [(block[0].upper(), sound_range(block[4]), None) for block in whole]
    places = tuple((f"place {block[0].upper()}", ",".join(block[1:4])) for block in whole)
    known = tuple((anchor, range_m, std_m) for anchor, range_m, std_m in ranges if range_m is not None)
    return ModuleReport(known, len(blocks) - len(known), (*places, *_position(tokens)))


def _is_whole(block: list[str]) -> bool:
    """An id and four decimals: x, y, z of the anchor and its range [m]."""
    return len(block) == 5 and bool(ID.fullmatch(block[0])) and all(DECIMAL.fullmatch(word) for word in block[1:])


def _position(tokens: list[str]) -> tuple[tuple[str, str], ...]:
    """The module's own position, where the line ends with one."""
    if "POS" not in tokens:
        return ()
    return (("position", ",".join(tokens[tokens.index("POS") + 1 :][:4])),)


def _short(text: str) -> ModuleReport:
    """The form of ``les``: anchors apart by blanks."""
    blocks = [word for word in text.split() if "]=" in word]
    found = [match for word in blocks if (match := SHORT.fullmatch(word))]
    ranges = tuple((m[1].upper(), range_m, None) for m in found if (range_m := sound_range(m[5])) is not None)
    places = tuple((f"place {m[1].upper()}", f"{m[2]},{m[3]},{m[4]}") for m in found)
    own = re.search(r"est\[([^\]]*)\]", text)
    is_other = not blocks and own is None and not text.startswith("dwm>")
    values = (*places, *((("position", own[1]),) if own else ()))
    return ModuleReport(ranges, len(blocks) - len(ranges) + is_other, values)


class UwbDwm1001(SerialRanging):
    """A DWM1001 tag."""

    summary: ClassVar[str] = "DWM1001 UWB tag on USB serial (PANS firmware, UART shell)"
    model: ClassVar[str] = "DWM1001"

    @classmethod
    def fake(cls) -> AbstractContextManager[FakeSerial]:
        """A tag that starts in its binary mode, as a real one does."""
        line = b"DIST,2,AN0,0A1B,0.00,0.00,0.00,1.25,AN1,15BA,4.00,0.00,0.00,2.50,POS,1.00,2.00,0.10,77\r\n"
        return fake_serial(line, b"DIST,1,AN0,0A1B,0.00,0,AN0,\r\n", FakeShell())

    def _begin(self) -> str:
        if FLOWING.search(self._collect(LISTEN_S, FLOWING)):
            return ""
        for _ in range(TRIES):
            self._port.write(b"\r")
            self._collect(0.1)
            self._port.write(b"\r")
            answer = self._collect(ANSWER_S, re.compile(re.escape(PROMPT)))
            if PROMPT in answer:
                self._port.write(b"lec\r")
                if FLOWING.search(self._collect(ANSWER_S, FLOWING)):
                    return ""
                raise ProtocolError(f"{self._name}: the shell is open, and no range comes", "is an anchor in reach?")
        binary = " (it answers in its binary mode)" if BINARY_ANSWER in answer else ""
        hint = "check port and baud rate; the module needs PANS firmware, as a tag"
        raise ProtocolError(f"{self._name}: no DWM1001 shell answers on {self._port.path}{binary}", hint)

    def _collect(self, duration_s: float, until: re.Pattern[bytes] | None = None) -> bytes:
        """All that comes in so long, or until it holds what is looked for."""
        end_ns = self._clock.now_ns() + int(duration_s * 1e9)
        collected = b""
        while self._clock.now_ns() < end_ns and not (until and until.search(collected)):
            collected += self._port.read(0.05)
        return collected

    def _reports(self, line: Line) -> Iterator[tuple[int, ModuleReport]]:
        yield line.time_ns, parse(line.text)


class FakeShell:
    """Answers as the module does: binary until two returns come, then a prompt, and ``lec`` starts the reports."""

    def __init__(self) -> None:
        self._returns = 0
        self._is_shell = False
        self.reports = False

    def answer(self, data: bytes) -> bytes:
        """Answer of the module to ``data``."""
        if not self._is_shell:
            self._returns += data.count(b"\r")
            if self._returns < 2:
                return b"\x40\x01\x01"
            self._is_shell = True
            return b"\r\n DWM1001 TWR Real Time Location System\r\n\r\ndwm> "
        if b"lec" in data:
            self.reports = not self.reports
        return b"\r\ndwm> "
