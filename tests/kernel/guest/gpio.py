"""GPIO lines whose levels a test sets, and the plainest way to hear their edges: the kernel's own ioctl.

Structures and numbers are those of Linux's include/uapi/linux/gpio.h, version 2.
"""

from __future__ import annotations

import fcntl
import os
import struct
import subprocess
from pathlib import Path
from typing import NamedTuple

from kernel.guest.system import load, wait_until

CONFIG, DRIVER = Path("/sys/kernel/config"), Path("/sys/bus/platform/drivers/gpio-sim")
INPUT, EDGE_RISING = 1 << 2, 1 << 4
REQUEST = struct.Struct("=64I32sQI20x240xII20xi")
GET_LINE = 3 << 30 | REQUEST.size << 16 | 0xB4 << 8 | 0x07
EVENT = struct.Struct("=QIIII24x")


class SimulatedGpio:
    """A chip of gpio-sim with the named lines; all levels low at first.

    `device` is what a driver opens, such as /dev/gpiochip0.
    """

    def __init__(self, names: list[str]) -> None:
        load("configfs")
        load("simulated_gpio")
        subprocess.run(["mount", "-t", "configfs", "configfs", str(CONFIG)], check=True)
        chip = CONFIG / "gpio-sim" / "robot"
        bank = chip / "bank"
        bank.mkdir(parents=True)
        (bank / "num_lines").write_text(str(len(names)))
        for number, name in enumerate(names):
            (bank / f"line{number}").mkdir()
            (bank / f"line{number}" / "name").write_text(name)
        (chip / "live").write_text("1")
        self._platform = (chip / "dev_name").read_text().strip()
        self.device = Path("/dev") / (bank / "chip_name").read_text().strip()
        self._lines = Path("/sys/devices/platform") / self._platform / self.device.name
        wait_until(self.device.exists, "the GPIO chip")

    def set_level(self, line: int, level: int) -> None:
        """Pull one line up (1) or down (0)."""
        pull = os.open(f"{self._lines}/sim_gpio{line}/pull", os.O_WRONLY)  # a robot's wheels do this all the time
        os.write(pull, b"pull-up" if level else b"pull-down")
        os.close(pull)

    def pulse(self, line: int, times: int = 1) -> None:
        """Rising edges, each followed by a falling one."""
        for _ in range(times):
            self.set_level(line, 1)
            self.set_level(line, 0)

    def unplug(self) -> None:
        """Take the chip from its driver, as a USB adapter pulled out would be."""
        (DRIVER / "unbind").write_text(self._platform)

    def plug(self) -> None:
        """Give it back."""
        (DRIVER / "bind").write_text(self._platform)
        wait_until(self.device.exists, "the GPIO chip")


class Edge(NamedTuple):
    """A rising edge: CLOCK_MONOTONIC, its line, its number in the request and its number on the line."""

    time_ns: int
    line: int
    number: int
    line_number: int


def request_rising_edges(device: Path, lines: list[int], buffer_size: int) -> int:
    """A file descriptor that hears the rising edges of `lines`; raises the kernel's `OSError`."""
    offsets = [*lines, *[0] * (64 - len(lines))]
    request = bytearray(REQUEST.pack(*offsets, b"kernel tier", INPUT | EDGE_RISING, 0, len(lines), buffer_size, 0))
    chip = os.open(device, os.O_RDWR)
    try:
        fcntl.ioctl(chip, GET_LINE, request)
    finally:
        os.close(chip)
    return int(REQUEST.unpack(request)[-1])


def read_edges(descriptor: int, count: int) -> list[Edge]:
    """The next `count` edges; blocks until they are there."""
    data = b""
    while len(data) < count * EVENT.size:
        data += os.read(descriptor, count * EVENT.size - len(data))
    return [Edge(time_ns, line, number, own) for time_ns, _, line, number, own in EVENT.iter_unpack(data)]
