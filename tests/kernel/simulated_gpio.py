"""Build the kernel's GPIO simulator, which Debian leaves out of its kernels, from Debian's own kernel source.

The source is the kernel's, under the GPL: it is fetched and compiled on this host, and never part of the repository.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from kernel.machine import GPIO_MODULE, MachineMissingError, tool

SOURCES = ("drivers/gpio/gpio-sim.c", "drivers/gpio/gpiolib.h", "kernel/irq/irq_sim.c")
NOT_EXPORTED, EXPORTED = "handle_simple_irq(irq_to_desc(irqnum))", "generic_handle_irq(irqnum)"
MAKEFILE = f"""\
obj-m := {GPIO_MODULE}.o
{GPIO_MODULE}-y := gpio-sim.o irq_sim.o
ccflags-y := -Wno-error
"""


def headers_wanted(dependencies: str) -> tuple[str, ...]:
    """The kernel's own packages among what apt says the headers depend on.

    >>> headers_wanted("Depends: linux-headers-6.12-common |Depends: gcc-12 Depends: linux-kbuild-6.12")
    ('linux-headers-6.12-common', 'linux-kbuild-6.12')
    """
    return tuple(word for word in dependencies.split() if word.startswith(("linux-headers-", "linux-kbuild-")))


def build(headers: Path, source: Path, release: str, workshop: Path) -> Path:
    """Compile the module in `workshop`, from unpacked header and source packages."""
    workshop.mkdir()
    (archive,) = (source / "usr" / "src").glob("linux-source-*.tar.xz")
    folder = archive.name.removesuffix(".tar.xz")
    members = [f"{folder}/{name}" for name in SOURCES]
    _run("tar", "-xJf", archive, "-C", workshop, "--transform", "s,.*/,,", "--occurrence=1", *members)
    simulator = workshop / "irq_sim.c"
    simulator.write_text(simulator.read_text().replace(NOT_EXPORTED, EXPORTED))
    (workshop / "Makefile").write_text(MAKEFILE)
    _run("make", "-C", _prepared(headers, release), f"M={workshop}", f"-j{os.cpu_count()}", "modules")
    return workshop / f"{GPIO_MODULE}.ko"


def _prepared(headers: Path, release: str) -> Path:
    """The headers' build folder, made to find the rest where we unpacked it."""
    folder = headers / "usr" / "src" / f"linux-headers-{release}"
    makefile = folder / "Makefile"
    makefile.write_text(makefile.read_text().replace("/usr/src/", f"{headers}/usr/src/"))
    (folder / "vmlinux").unlink(missing_ok=True)  # with it the build asks for pahole, to add type information
    return folder


def _run(program: str, *arguments: str | Path) -> None:
    ran = subprocess.run([tool(program), *arguments], capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        raise MachineMissingError(f"{program} failed: {ran.stderr.strip()[-500:]}")
