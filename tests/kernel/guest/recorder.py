"""`fusion record` beside a job: a forked process, since an interpreter of its own would cost seconds to start."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
from multiprocessing.connection import Connection
from pathlib import Path

from fusion.cli.main import main
from kernel.guest.system import wait_until

SLOW_IMPORTS = ("gpiod", "smbus2", "serialx", "pyroute2.netlink.generic")
"""What drivers import when they open. It takes seconds in emulation, and a recording waits ten for its sensors."""


class Recorder:
    """Forked when it is made, before there is any thread; records from `begin` on."""

    def __init__(self, robot_file: Path, folder: Path) -> None:
        for name in SLOW_IMPORTS:
            importlib.import_module(name)
        self._folder = folder
        processes = multiprocessing.get_context("fork")
        there, self._here = processes.Pipe(duplex=False)
        self._process = processes.Process(target=_record, args=(there, robot_file, folder), daemon=True)
        self._process.start()

    def begin(self) -> None:
        """Record; comes back when the log is begun, for which all sensors must be open."""
        self._here.send("begin")
        wait_until(lambda: not self._process.is_alive() or self.size, "the log")
        if not self._process.is_alive():
            raise RuntimeError(f"fusion record ended at once: exit code {self._process.exitcode}")

    @property
    def size(self) -> int:
        """Bytes recorded so far."""
        return sum(path.stat().st_size for path in self._folder.glob("*.mcap"))

    def end(self, by: signal.Signals) -> int | None:
        """Send it a signal; how it ended: an exit code, or the signal's number below zero."""
        os.kill(self._process.pid or 0, by)
        self._process.join()
        return self._process.exitcode


def _record(told: Connection, robot_file: Path, folder: Path) -> None:
    told.recv()
    sys.exit(main(["record", str(robot_file), "-o", str(folder)]))
