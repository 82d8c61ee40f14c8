"""A USB serial device made by the guest itself: its far end is ours, its near end is what a driver opens."""

from __future__ import annotations

import os
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kernel.guest.system import load, unload, wait_until

FAR, NEAR = Path("/dev/ttyGS0"), Path("/dev/ttyACM0")


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
