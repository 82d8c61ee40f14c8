"""Bring the kernel and the guest programs: downloaded by apt under their package names, unpacked, never installed.

Run as ``python -m kernel.fetch`` on a Debian. Needs no root: apt's lists are fetched anew into a folder of our own,
from the archives that this host's apt knows; its own lists may be absent, and stay as they are.
"""

from __future__ import annotations

import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from kernel import simulated_gpio
from kernel.machine import Machine, MachineMissingError, cache, find, tool

PROGRAMS = ("hostapd", "iw", "libnl-3-200", "libnl-genl-3-200", "libnl-route-3-200")
OLDEST_KERNEL = (6, 4)
"""The first whose simulated radios measure ranges (FTM)."""


class Apt:
    """apt with lists of its own in `folder`, of the archives that this host's apt knows for this Debian release."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for name in ("lists/partial", "archives/partial"):
            (folder / name).mkdir(parents=True)
        self._options: tuple[str, ...] = ()
        self._codename = platform.freedesktop_os_release().get("VERSION_CODENAME", "")
        self._sources = list(self._known())
        self._options = (
            *("-o", f"Dir::Etc::sourcelist={folder / 'sources.list'}"),
            *("-o", "Dir::Etc::sourceparts=/dev/null"),
            *("-o", f"Dir::State::lists={folder / 'lists'}"),
            *("-o", f"Dir::Cache={folder}"),
        )
        self._update()

    def _known(self) -> Iterator[tuple[str, str]]:
        """Each archive's address and suite, such as bookworm and bookworm-security."""
        planned = self._ask("apt-get", "update", "--print-uris")
        for site, suite in re.findall(r"'(\S+)/dists/(\S+)/InRelease'", planned):
            if suite.partition("-")[0] == self._codename:
                yield site, suite

    def _update(self) -> None:
        lines = [f"deb {site} {suite} main\n" for site, suite in self._sources]
        (self._folder / "sources.list").write_text("".join(lines))
        self._ask("apt-get", "-q", "update")

    def add_backports(self) -> None:
        """Know this release's backports too, and prefer them."""
        suite = f"{self._codename}-backports"
        self._sources += [(site, suite) for site, known in self._sources if known == self._codename]
        self._options += ("-o", f"APT::Default-Release={suite}")
        self._update()

    def depends(self, package: str) -> str:
        """What `package` depends on, as apt says it."""
        return self._ask("apt-cache", "depends", package)

    def kernel_package(self) -> str:
        """What Debian's kernel metapackage stands for now, such as linux-image-6.12.95+deb12-amd64."""
        for line in self.depends("linux-image-amd64").splitlines():
            if line.strip().startswith("Depends: linux-image-"):
                return line.split()[-1]
        raise MachineMissingError("apt knows no linux-image-amd64 here: this tier needs a Debian on x86-64")

    def unpack(self, packages: tuple[str, ...], target: Path) -> None:
        """Download `packages` and unpack them all into `target`."""
        downloads = self._folder / target.name
        downloads.mkdir()
        self._ask("apt-get", "-q", "download", *packages, cwd=downloads)
        for package in sorted(downloads.glob("*.deb")):
            subprocess.run([tool("dpkg-deb"), "-x", package, target], check=True)

    def _ask(self, program: str, *arguments: str, cwd: Path | None = None) -> str:
        command = [tool(program), *self._options, *arguments]
        ran = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
        if ran.returncode != 0:
            raise MachineMissingError(f"{' '.join(command)} failed: {ran.stderr.strip()}")
        return ran.stdout


def version_of(package: str) -> tuple[int, int]:
    """The first two numbers of a kernel package's name.

    >>> version_of("linux-image-6.12.95+deb12-amd64")
    (6, 12)
    """
    major, minor = package.removeprefix("linux-image-").split(".")[:2]
    return int(major), int(minor)


def unpack_kernel(apt: Apt, target: Path) -> None:
    """Debian's kernel, from backports if this release's own is too old."""
    package = apt.kernel_package()
    if version_of(package) < OLDEST_KERNEL:
        apt.add_backports()
        package = apt.kernel_package()
    if version_of(package) < OLDEST_KERNEL:
        raise MachineMissingError(f"apt's newest kernel is {package}; simulated radios measure ranges from 6.4 on")
    print(f"kernel tier: unpacking {package}")
    apt.unpack((package,), target)
    release = package.removeprefix("linux-image-")
    try:
        _add_gpio(apt, release, target)
    except MachineMissingError as missing:
        (target / "without-gpio").write_text(f"gpio-sim could not be built: {missing}")
        print(f"kernel tier: gpio-sim could not be built: {missing}")
    # The package ships no modules.dep: its installation would write it.
    subprocess.run([tool("depmod"), "-b", target, release], check=True)


def _add_gpio(apt: Apt, release: str, kernel: Path) -> None:
    """The one simulated device that Debian's kernel lacks."""
    major, minor = version_of(release)
    headers, source, workshop = (kernel.parent / name for name in ("headers", "source", "workshop"))
    package = f"linux-headers-{release}"
    apt.unpack((package, *simulated_gpio.headers_wanted(apt.depends(package))), headers)
    apt.unpack((f"linux-source-{major}.{minor}",), source)
    module = simulated_gpio.build(headers, source, release, workshop)
    extra = kernel / "lib" / "modules" / release / "extra"
    extra.mkdir()
    module.rename(extra / module.name)


def unpack_programs(apt: Apt, target: Path) -> None:
    """What runs in the guest beside Python."""
    apt.unpack(PROGRAMS, target)


PARTS = {"programs": unpack_programs, "kernel": unpack_kernel}


def fetch() -> Machine:
    """The machine; parts that are missing are brought first, each whole or not at all."""
    missing = [name for name in PARTS if not (cache() / name).is_dir()]
    if missing:
        cache().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache()) as scratch:
            apt = Apt(Path(scratch, "apt"))
            for name in missing:
                PARTS[name](apt, Path(scratch, name))
                Path(scratch, name).rename(cache() / name)
    return find()


if __name__ == "__main__":
    try:
        print(f"kernel tier: {fetch().release} in {cache()}")
    except MachineMissingError as missing:
        sys.exit(f"kernel tier: {missing}")
