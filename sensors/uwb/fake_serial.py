"""A serial device that is not there: a pseudo-terminal with somebody on its other end. The kernel's own tty code runs.

The port is a symbolic link, as the names under /dev/serial/by-id are: unplugging removes it and closes the terminal.
"""

from __future__ import annotations

import os
import select
import tempfile
import threading
import tty
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from fusion import BootClock

REPORT_S = 0.1


class Talker(Protocol):
    """The firmware of a fake device: its answers, and whether it reports by itself."""

    reports: bool

    def answer(self, data: bytes) -> bytes:
        """Answer to ``data``."""


class Mute:
    """A firmware that sends only when the test asks for it."""

    reports = False

    def answer(self, _data: bytes) -> bytes:
        """Nothing."""
        return b""


class FakeSerial:
    """The device: ``speech`` is one whole message of it, ``nonsense`` cannot be parsed."""

    def __init__(self, folder: Path, speech: bytes, nonsense: bytes, talker: Talker) -> None:
        self.clock = BootClock()
        self._link = folder / "usb-fake"
        self.settings: Mapping[str, object] = {"port": str(self._link)}
        self._speech, self._nonsense, self._talker = speech, nonsense, talker
        self._ends: tuple[int, int] | None = None
        self._thread: threading.Thread | None = None
        self._gone = threading.Event()

    def speak(self) -> None:
        """Send one whole message."""
        self._send(self._speech)

    def garble(self) -> None:
        """Send nonsense."""
        self._send(self._nonsense)

    def plug(self) -> None:
        """Give the device back."""
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        self._ends = ours, theirs
        self._link.symlink_to(os.ttyname(theirs))
        self._gone.clear()
        self._thread = threading.Thread(target=self._serve, args=(ours,), daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Take it away."""
        if self._ends is None or self._thread is None:
            return
        self._gone.set()
        self._thread.join()
        self._link.unlink()
        for end in self._ends:
            os.close(end)
        self._ends = None

    def _send(self, data: bytes) -> None:
        if self._ends is not None:
            os.write(self._ends[0], data)

    def _serve(self, ours: int) -> None:
        """Answer requests, and report while the firmware is set to."""
        while not self._gone.is_set():
            if select.select([ours], [], [], REPORT_S / 2.0)[0]:
                with suppress(OSError):
                    os.write(ours, self._talker.answer(os.read(ours, 4096)))
            elif self._talker.reports:
                os.write(ours, self._speech)


@contextmanager
def fake_serial(speech: bytes, nonsense: bytes, talker: Talker | None = None) -> Iterator[FakeSerial]:
    """A fake device, plugged in for the length of a ``with`` block."""
    with tempfile.TemporaryDirectory() as folder:
        device = FakeSerial(Path(folder), speech, nonsense, talker or Mute())
        device.plug()
        try:
            yield device
        finally:
            device.unplug()
