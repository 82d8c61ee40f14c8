"""Bring the kernel and the guest programs: downloaded by apt under their package names, unpacked, never installed.

Run as ``python -m kernel.fetch``. Needs a Debian whose apt knows its archive; no root, except for apt's own lists.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from kernel.machine import Machine, MachineMissingError, cache, find, tool

PROGRAMS = ("hostapd", "iw", "libnl-3-200", "libnl-genl-3-200", "libnl-route-3-200")
OLDEST_KERNEL = (6, 4)
"""The first whose simulated radios measure ranges (FTM)."""


class Apt:
    """apt as this host has it set up or, given a `folder`, with that folder's sources and lists instead."""

    def __init__(self, folder: Path | None = None) -> None:
        self.options = () if folder is None else _private(folder)

    def ask(self, program: str, *arguments: str, cwd: Path | None = None) -> str:
        """The output of one apt program."""
        command = [tool(program), *self.options, *arguments]
        ran = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
        if ran.returncode != 0:
            raise MachineMissingError(f"{' '.join(command)} failed: {ran.stderr.strip()}")
        return ran.stdout

    def kernel_package(self) -> str:
        """What Debian's kernel metapackage stands for now, such as linux-image-6.12.95+deb12-amd64."""
        for line in self.ask("apt-cache", "depends", "linux-image-amd64").splitlines():
            if line.strip().startswith("Depends: linux-image-"):
                return line.split()[-1]
        raise MachineMissingError("apt knows no linux-image-amd64: run apt-get update; the host must be a Debian")

    def unpack(self, packages: tuple[str, ...], target: Path) -> None:
        """Download `packages` and unpack them all into `target`."""
        with tempfile.TemporaryDirectory() as downloads:
            self.ask("apt-get", "-q", "download", *packages, cwd=Path(downloads))
            for package in sorted(Path(downloads).glob("*.deb")):
                subprocess.run([tool("dpkg-deb"), "-x", package, target], check=True)


def _private(folder: Path) -> tuple[str, ...]:
    for name in ("lists/partial", "archives/partial"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    settings = {
        "Dir::Etc::sourcelist": folder / "backports.list",
        "Dir::Etc::sourceparts": "/dev/null",
        "Dir::State::lists": folder / "lists",
        "Dir::Cache": folder,
    }
    return tuple(word for name, value in settings.items() for word in ("-o", f"{name}={value}"))


def version_of(package: str) -> tuple[int, int]:
    """The first two numbers of a kernel package's name.

    >>> version_of("linux-image-6.12.95+deb12-amd64")
    (6, 12)
    """
    major, minor = package.removeprefix("linux-image-").split(".")[:2]
    return int(major), int(minor)


def backports(folder: Path) -> Apt:
    """The same archive's backports, in lists of our own: the host's apt stays as it is."""
    fields = "$(REPO_URI) $(CODENAME) $(COMPONENT)"
    known = Apt().ask("apt-get", "indextargets", "--format", fields, "Created-By: Packages", "Label: Debian")
    for site, suite, component in (line.split() for line in known.splitlines()):
        if component == "main" and "-" not in suite:
            apt = Apt(folder)
            (folder / "backports.list").write_text(f"deb {site} {suite}-backports main\n")
            apt.ask("apt-get", "-q", "update")
            return apt
    raise MachineMissingError("apt has no Debian archive in its sources, so no kernel can be had from it")


def _fetch_kernel(scratch: Path) -> None:
    apt = Apt()
    package = apt.kernel_package()
    if version_of(package) < OLDEST_KERNEL:
        apt = backports(scratch / "apt")
        package = apt.kernel_package()
    print(f"kernel tier: unpacking {package}")
    apt.unpack((package,), scratch / "kernel")
    release = package.removeprefix("linux-image-")
    subprocess.run([tool("depmod"), "-b", scratch / "kernel", release], check=True)


def fetch() -> Machine:
    """The machine, its missing parts brought first."""
    cache().mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache()) as folder:
        scratch = Path(folder)
        if not (cache() / "kernel").is_dir():
            _fetch_kernel(scratch)
            (scratch / "kernel").rename(cache() / "kernel")
        if not (cache() / "programs").is_dir():
            Apt().unpack(PROGRAMS, scratch / "programs")
            (scratch / "programs").rename(cache() / "programs")
    return find()


if __name__ == "__main__":
    try:
        print(f"kernel tier: {fetch().release} in {cache()}")
    except MachineMissingError as missing:
        sys.exit(f"kernel tier: {missing}")
