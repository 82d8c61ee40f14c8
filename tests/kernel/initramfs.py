"""The guest's first file system: busybox, the modules that mount the host's files, and the script that does it."""

from __future__ import annotations

import lzma
import shutil
import subprocess
import tempfile
from pathlib import Path

from kernel.machine import Machine, tool

MOUNTING = ("virtio_pci", "9pnet_virtio", "9p", "overlay")
"""The modules that mount the host's files; what they stand on is asked of modprobe."""


def modules_in_order(machine: Machine, names: tuple[str, ...] = MOUNTING) -> list[Path]:
    """The module files behind `names`, each after those it needs; nothing for what is built into the kernel."""
    files: dict[Path, None] = {}
    for name in names:
        command = [tool("modprobe"), "-d", str(machine.kernel), "-S", machine.release, "--show-depends", name]
        shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        files |= {Path(line.split()[1]): None for line in shown.splitlines() if line.startswith("insmod ")}
    return list(files)


def build(machine: Machine, target: Path) -> None:
    """Write the initramfs to `target`, as gzip of cpio."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in ("bin", "dev", "proc", "sys", "host", "overlay", "newroot", "modules"):
            (root / name).mkdir()
        shutil.copy(tool("busybox"), root / "bin" / "busybox")
        shutil.copy(Path(__file__).parent / "guest" / "init", root / "init")
        (root / "init").chmod(0o755)
        for place, module in enumerate(modules_in_order(machine)):
            _copy_plain(module, root / "modules" / f"{place:02}-{module.name.removesuffix('.xz')}")
        pack = 'find . | "$0" -o -H newc --quiet | gzip -1'
        with target.open("wb") as archive:
            subprocess.run(["/bin/sh", "-c", pack, tool("cpio")], cwd=root, stdout=archive, check=True)


def _copy_plain(module: Path, target: Path) -> None:
    """Busybox loads no compressed modules."""
    data = module.read_bytes()
    target.write_bytes(lzma.decompress(data) if module.suffix == ".xz" else data)
