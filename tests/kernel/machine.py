"""What the emulated machine is made of, and where its parts lie on this host."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

HOST_TOOLS = {
    "qemu-system-x86_64": "qemu-system-x86",
    "busybox": "busybox-static",
    "cpio": "cpio",
    "modprobe": "kmod",
}
"""Programs of the host, and the Debian package of each."""

GPIO_MODULE = "simulated_gpio"
"""The kernel's gpio-sim, built by `simulated_gpio`; under another name, so that it cannot be taken for the original."""

RECIPE = 1
"""To be raised whenever `fetch` unpacks or builds something else, so that no old folder is taken for a new one."""

HOW_TO_FETCH = "run make kernel-parts"


class MachineMissingError(Exception):
    """A part of the machine is not on this host; the message says which, and how to get it."""


@dataclass(frozen=True)
class Machine:
    """The parts of one emulated machine.

    `kernel` has Debian's kernel package as it unpacks (boot, lib/modules), `programs` the guest programs that this
    host may lack (hostapd, iw and their libraries).
    """

    kernel: Path
    programs: Path

    @property
    def release(self) -> str:
        """The kernel's release, as uname says it."""
        return self.modules.name

    @property
    def image(self) -> Path:
        """What the emulator starts."""
        return self.kernel / "boot" / f"vmlinuz-{self.release}"

    @property
    def modules(self) -> Path:
        """The folder with modules.dep."""
        return next((self.kernel / "lib" / "modules").iterdir())

    @property
    def without_gpio(self) -> str | None:
        """Why there is no simulated GPIO; None where there is."""
        reason = self.kernel / "without-gpio"
        return reason.read_text() if reason.is_file() else None


def cache() -> Path:
    """The folder of unpacked packages: outside the repository, rebuilt when missing."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fusion-kernel" / str(RECIPE)


def tool(name: str) -> str:
    """The path of a program of the host; administrators' folders count, though a user's PATH may lack them."""
    found = shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
    if found is None:
        remedy = f"apt-get install {' '.join(HOST_TOOLS.values())}" if name in HOST_TOOLS else "this needs a Debian"
        raise MachineMissingError(f"{name} is not installed: {remedy}")
    return found


def find() -> Machine:
    """The machine, if all its parts are here; otherwise `MachineMissingError`."""
    for name in HOST_TOOLS:
        tool(name)
    machine = Machine(cache() / "kernel", cache() / "programs")
    for part in (machine.kernel, machine.programs):
        if not part.is_dir():
            raise MachineMissingError(f"no Debian packages unpacked in {part}: {HOW_TO_FETCH}")
    return machine
