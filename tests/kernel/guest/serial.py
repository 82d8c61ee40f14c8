"""A USB serial device made by the guest itself: its far end is ours, its near end is what a driver opens."""

from __future__ import annotations

import os
import select
import termios
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Protocol

from kernel.guest.system import load, unload, wait_until

FAR, NEAR = Path("/dev/ttyGS0"), Path("/dev/ttyACM0")
REPORT_S = 0.1


class UsbSerial:
    """The gadget g_serial on the simulated host controller dummy_hcd; a driver meets it as cdc_acm.

    There is no udev, hence no /dev/serial/by-id.
    """

    def __init__(self) -> None:
        load("cdc_acm")
        load("dummy_hcd")

    def plug(self) -> None:
        """Put the cable in, and wait for both ends."""
        load("g_serial")
        wait_until(lambda: FAR.exists() and NEAR.exists(), "the USB serial port")

    def unplug(self) -> None:
        """Pull the cable; the far end must be closed, or this would wait for that."""
        unload("g_serial")


@contextmanager
def raw(path: Path) -> Iterator[int]:
    """A file descriptor of a terminal without echo, line editing or translation."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
    try:
        settings = termios.tcgetattr(descriptor)
        settings[0] = settings[1] = settings[3] = 0
        settings[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        termios.tcsetattr(descriptor, termios.TCSANOW, settings)
        yield descriptor
    finally:
        os.close(descriptor)


class Firmware(Protocol):
    """What a module is made of: whether it reports by itself, and what it answers."""

    reports: bool

    def answer(self, data: bytes) -> bytes:
        """What it sends back for ``data``."""


class Module:
    """Somebody at the far end, in a thread, for the length of a ``with`` block; ``line`` is what it reports by itself.

    Bytes that nobody takes are lost, as on a real module: the far end must not wait, or the cable could not be pulled.
    """

    def __init__(self, firmware: Firmware, line: str) -> None:
        self._firmware, self._line = firmware, line.encode()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="module", daemon=True)

    def __enter__(self) -> Module:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        self._thread.join()

    def _serve(self) -> None:
        with raw(FAR) as far:
            os.set_blocking(far, False)
            while not self._closing.is_set():
                asked = select.select([far], [], [], REPORT_S)[0]
                data = self._firmware.answer(os.read(far, 4096)) if asked else self._report()
                with suppress(BlockingIOError):
                    os.write(far, data)

    def _report(self) -> bytes:
        return self._line if self._firmware.reports else b""
