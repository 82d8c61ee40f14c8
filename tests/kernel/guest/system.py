"""The few things every job asks of the guest's kernel: modules, interfaces, and to wait for what it makes."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable


def load(module: str, *options: str) -> None:
    """modprobe; the module's own dependencies come with it."""
    subprocess.run(["modprobe", module, *options], check=True)


def unload(module: str) -> None:
    """modprobe -r: for a gadget, the cable pulled out."""
    subprocess.run(["modprobe", "-r", module], check=True)


def set_link(interface: str, state: str) -> None:
    """Take a network interface `up` or `down`."""
    subprocess.run(["busybox", "ip", "link", "set", interface, state], check=True)


def wait_until(holds: Callable[[], object], what: str, limit_s: float = 60.0) -> None:
    """Wait for something the kernel or a program brings about; `TimeoutError` names it."""
    deadline = time.monotonic() + limit_s
    while not holds():
        if time.monotonic() > deadline:
            raise TimeoutError(f"{what}: not there after {limit_s:.0f} s")
        time.sleep(0.02)
