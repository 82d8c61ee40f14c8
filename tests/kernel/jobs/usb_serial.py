"""A USB serial device that speaks, is pulled out while it is open, and comes back."""

from __future__ import annotations

import os
import select
from pathlib import Path
from typing import Any

from kernel.guest.serial import FAR, NEAR, UsbSerial, raw
from kernel.guest.system import wait_until


def run(line: str) -> dict[str, Any]:
    """What arrives of `line` before and after, and what an open and a closed port say in between."""
    device = UsbSerial()
    device.plug()
    with raw(NEAR) as near:
        seen: dict[str, Any] = {"usb id": usb_id(), "before": carry(line, near)}
        device.unplug()
        seen["open port"] = after_loss(near)
    wait_until(lambda: not NEAR.exists(), "the node's end")
    seen["open without node"] = errno_of_open()
    device.plug()
    with raw(NEAR) as near:
        seen["after"] = carry(line, near)
    return seen


def usb_id() -> str:
    """Vendor and product, as the bus says them."""
    device = Path("/sys/class/tty") / NEAR.name / "device" / ".."
    return ":".join((device / name).read_text().strip() for name in ("idVendor", "idProduct"))


def carry(line: str, near: int) -> str:
    """Write at the far end, read at the near one."""
    with raw(FAR) as far:
        os.write(far, line.encode())
        return os.read(near, 256).decode()


def after_loss(near: int) -> dict[str, Any]:
    """poll's answer, and what reading gives: bytes, or an errno."""
    poll = select.poll()
    poll.register(near, select.POLLIN)
    ((_, events),) = poll.poll(60_000)
    try:
        return {"hung up": bool(events & select.POLLHUP), "read": os.read(near, 256).decode()}
    except OSError as error:
        return {"hung up": bool(events & select.POLLHUP), "errno": error.errno}


def errno_of_open() -> int | None:
    """Of a port that is not there."""
    try:
        with raw(NEAR):
            return None
    except OSError as error:
        return error.errno
