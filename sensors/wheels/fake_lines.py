"""A chip that is not there, and the wheels that turn in front of it."""

from __future__ import annotations

import errno
from collections.abc import Sequence

from fusion import BootClock
from sensors.wheels.gpio_lines import BUFFER, Edge


class FakeLines:
    """A chip with two lines: the device of `GpioLines` and, for the kit, the wheels that turn in front of it."""

    model = "fake lines"

    def __init__(self) -> None:
        self.clock = BootClock()
        self.settings = {"lines": (17, 27), "chip": "/dev/fake", "device": lambda: self}
        self._is_there = True
        self._numbers: dict[int, int] = {}
        self._edges: list[Edge] = []

    def turn(self, ticks: int) -> None:
        """Both wheels roll on by so many ticks; what is not read is lost but for the last `BUFFER` edges."""
        for _ in range(ticks):
            for line in self._numbers:
                self._numbers[line] += 1
                self._edges.append(Edge(line, self._numbers[line]))
        del self._edges[:-BUFFER]

    def speak(self) -> None:
        """Turn by a few ticks, for the next report."""
        self.turn(3)

    def garble(self) -> None:
        """Turn so fast that edges are lost on the way."""
        self.turn(2 * BUFFER)

    def unplug(self) -> None:
        """Take the chip away."""
        self._is_there = False

    def plug(self) -> None:
        """Give it back."""
        self._is_there = True

    def open(self, chip: str, lines: Sequence[int], _debounce_s: float) -> None:
        """As the kernel does: numbers begin at 1 with each request."""
        if not self._is_there:
            raise OSError(errno.ENOENT, "No such file or directory", chip)
        self._numbers = dict.fromkeys(lines, 0)
        self._edges = []

    def wait(self, timeout_s: float) -> bool:
        """As the kernel does: a chip that is gone is always ready, and reading gives the reason."""
        if not self._edges and self._is_there:
            self.clock.sleep(timeout_s)
        return bool(self._edges) or not self._is_there

    def read(self) -> list[Edge]:
        """Edges since the last read."""
        if not self._is_there:
            raise OSError(errno.ENODEV, "No such device")
        edges, self._edges = self._edges, []
        return edges

    def close(self) -> None:
        """Let go."""
        self._edges = []
