"""Edges on the lines of a GPIO chip, by libgpiod: the device part of the encoders, and the one place that knows it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta
from typing import Any, NamedTuple, Protocol

from sensors.device_errors import missing_package

BUFFER = 1024
"""Edges the kernel keeps for us, its greatest number: five seconds at a metre a second with 20 ticks a turn."""
CONSUMER = "fusion"


class Edge(NamedTuple):
    """One edge: the line it was seen on, and its number on that line since the lines were requested, from 1."""

    line: int
    number: int


class Lines(Protocol):
    """The device: what the driver needs of a GPIO chip. `GpioLines` is the real one, `FakeLines` the other."""

    model: str

    def open(self, chip: str, lines: Sequence[int], debounce_s: float) -> None:
        """Ask for rising edges on ``lines``; raises OSError."""

    def wait(self, timeout_s: float) -> bool:
        """Whether there is something to read, waiting at most so long for it."""

    def read(self) -> list[Edge]:
        """All that was seen and not read; raises OSError when the chip is gone."""

    def close(self) -> None:
        """Let go."""


class GpioLines:
    """Lines of a GPIO chip by libgpiod."""

    model = "GPIO lines"

    def __init__(self) -> None:
        self._request: Any = None

    def open(self, chip: str, lines: Sequence[int], debounce_s: float) -> None:
        """Ask for them; raises OSError, or `DependencyError`."""
        try:
            import gpiod
        except ImportError as error:
            raise missing_package("gpiod") from error
        period = timedelta(seconds=debounce_s)
        settings = gpiod.LineSettings(edge_detection=gpiod.line.Edge.RISING, debounce_period=period)
        self._request = gpiod.request_lines(chip, {tuple(lines): settings}, CONSUMER, event_buffer_size=BUFFER)

    def wait(self, timeout_s: float) -> bool:
        """Whether there is something to read."""
        return bool(self._request.wait_edge_events(timeout_s))

    def read(self) -> list[Edge]:
        """All that was seen and not read: left to itself the library would hand out 64 edges at a time."""
        return [Edge(event.line_offset, event.line_seqno) for event in self._request.read_edge_events(BUFFER)]

    def close(self) -> None:
        """Let go."""
        request, self._request = self._request, None
        if request is not None:
            request.release()
