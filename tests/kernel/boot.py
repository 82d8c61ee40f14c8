"""Run one job in a fresh guest and bring back what it saw.

The guest sees the host's whole file system read-only, so it runs this very interpreter and environment; what it writes
vanishes, but for one shared folder: `start` and `arguments.json` go in, `output`, `status` and `answer.json` come out.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kernel.machine import Machine, tool

TESTS = Path(__file__).parent.parent
LIMIT_S = 300.0
"""An idle host needs 15-60 s for a job; one that never ends must still fail the test."""

COUNTED = ("-icount", "shift=2")
"""The guest's clock counts instructions, 4 ns each, while it works: where the host is slow, so is the guest's time."""

START = """\
cd {project}
export HOME=/tmp LANG=C.UTF-8 PYTHONPATH={tests} LD_LIBRARY_PATH={libraries}
export PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin:{programs}
{python} -m kernel.guest.runner {job} >/run/job/output 2>&1
echo $? >/run/job/status
echo 1 >/proc/sys/kernel/sysrq
echo o >/proc/sysrq-trigger
"""


class GuestError(AssertionError):
    """The guest did not start, its job failed, or it never ended; the message has the ends of its outputs."""


@dataclass(frozen=True)
class Result:
    """What one job left: its `answer` (anything JSON holds), what it printed, and the `folder` it could write to."""

    answer: Any
    output: str
    folder: Path


def run(
    machine: Machine,
    initramfs: Path,
    share: Path,
    job: str,
    /,
    limit_s: float = LIMIT_S,
    clock: tuple[str, ...] = (),
    **arguments: Any,
) -> Result:
    """Boot, run ``kernel.jobs.<job>.run(**arguments)`` with `share` as /run/job, power off.

    `clock` is `COUNTED` for a guest whose time must not depend on how busy the host is.

    Raises `GuestError` when the guest does not come up, the job raises, or `limit_s` passes.
    """
    (share / "start").write_text(_start(machine, job))
    (share / "arguments.json").write_text(json.dumps(arguments))
    console = share / "console"
    with console.open("wb") as log:
        command = [*_emulator(machine, initramfs, share), *clock]
        try:
            subprocess.run(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=limit_s, check=False)
        except subprocess.TimeoutExpired:
            raise GuestError(_story(share, f"{job} had not ended after {limit_s:g} s")) from None
    if not (share / "status").is_file() or (share / "status").read_text().strip() != "0":
        raise GuestError(_story(share, f"{job} failed in the guest"))
    return Result(json.loads((share / "answer.json").read_text()), (share / "output").read_text(), share)


def _start(machine: Machine, job: str) -> str:
    programs = [machine.programs / name for name in ("usr/sbin", "usr/bin", "sbin", "bin")]
    libraries = [machine.programs / name / "x86_64-linux-gnu" for name in ("usr/lib", "lib")]
    words = {"project": TESTS.parent, "tests": TESTS, "python": sys.executable, "job": job}
    return START.format(
        programs=":".join(map(shlex.quote, map(str, programs))),
        libraries=":".join(map(shlex.quote, map(str, libraries))),
        **{name: shlex.quote(str(word)) for name, word in words.items()},
    )


def _emulator(machine: Machine, initramfs: Path, share: Path) -> list[str]:
    """Plain emulation: no hardware virtualisation, which hosted runners lack, and no disk image.

    Without `no_timer_check` the kernel panics on a busy host, when its first timer ticks come too late.
    """
    words = f"console=ttyS0 quiet panic=-1 loglevel=3 no_timer_check modules={machine.modules}"
    read_only = "readonly=on,multidevs=remap"
    return [
        *(tool("qemu-system-x86_64"), "-accel", "tcg", "-cpu", "max", "-smp", "1", "-m", "1024"),
        *("-display", "none", "-no-reboot", "-nodefaults", "-serial", "stdio"),
        *("-kernel", str(machine.image), "-initrd", str(initramfs), "-append", words),
        *("-fsdev", f"local,id=host,path=/,security_model=none,{read_only}"),
        *("-device", "virtio-9p-pci,fsdev=host,mount_tag=host"),
        *("-fsdev", f"local,id=job,path={share},security_model=none,multidevs=remap"),
        *("-device", "virtio-9p-pci,fsdev=job,mount_tag=job"),
    ]


def _story(share: Path, what: str) -> str:
    parts = [what]
    for name in ("output", "console"):
        text = (share / name).read_text(errors="replace") if (share / name).is_file() else "(nothing)"
        parts.append(f"--- {name} ---\n{text[-4000:]}")
    return "\n".join(parts)
