"""Faults of what a radio hears: noise, a changed transmit power, obstructed links, wild readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from benchmarks.faults.fault import Fault
from benchmarks.faults.row_selection import Floats, Mask, Windows
from benchmarks.faults.run_columns import Tape

RADIO_TOPICS = ("ranges", "wifi")
RESOLUTIONS_DB = (1.0, 0.5, 0.1)
"""Steps in which receivers tell signal strengths; a log that keeps to none of them is not rounded."""


@dataclass(frozen=True, slots=True)
class RssiNoise(Fault):
    """More Gaussian noise on signal strengths [dB], rounded as the log is."""

    kind: ClassVar[str] = "rssi_noise"
    std_db: float
    source: str = ""
    windows: Windows | None = None

    def strike(self, tape: Tape, random: np.random.Generator) -> None:
        """One draw a reading."""
        noisy = tape.readings.select("wifi", self.source, self.windows)
        noise = self.std_db * tape.readings.draw("wifi", random.standard_normal)
        _tell(tape, "wifi", noisy, tape.value + noise)


@dataclass(frozen=True, slots=True)
class PowerStep(Fault):
    """An anchor's transmit power changes by ``step_db`` for good, ``from_s`` after the run's start."""

    kind: ClassVar[str] = "power_step"
    source: str
    step_db: float
    from_s: float = 0.0

    def strike(self, tape: Tape, random: np.random.Generator) -> None:  # noqa: ARG002 - no chance in it
        """Shift the readings after the step."""
        tape.value[tape.readings.select("wifi", self.source, ((self.from_s, np.inf),))] += self.step_db

    @property
    def lasts(self) -> Windows:
        """For ever from the step on, if that is not the whole run."""
        return ((self.from_s, np.inf),) if self.from_s > 0.0 else ()


@dataclass(frozen=True, slots=True)
class Nlos(Fault):
    """No line of sight: readings take an exponentially distributed detour of ``mean`` [m], or lose ``mean`` [dB] of
    signal strength. Each with probability ``p``, in ``windows`` or always.
    """

    kind: ClassVar[str] = "nlos"
    topics: ClassVar[tuple[str, ...]] = RADIO_TOPICS
    topic: str
    mean: float
    source: str = ""
    windows: Windows | None = None
    p: float = 1.0

    def strike(self, tape: Tape, random: np.random.Generator) -> None:
        """Two draws a reading: whether it is struck, and how far."""
        struck = tape.readings.select(self.topic, self.source, self.windows)
        struck &= tape.readings.draw(self.topic, random.random) < self.p
        excess = self.mean * tape.readings.draw(self.topic, random.standard_exponential)
        _tell(tape, self.topic, struck, tape.value + (excess if self.topic == "ranges" else -excess))


@dataclass(frozen=True, slots=True)
class Outlier(Fault):
    """Readings are replaced, each with probability ``p``, by a uniform draw from ``span`` [m, or dBm]."""

    kind: ClassVar[str] = "outlier"
    topics: ClassVar[tuple[str, ...]] = RADIO_TOPICS
    topic: str
    p: float
    span: tuple[float, float]
    source: str = ""
    windows: Windows | None = None

    def strike(self, tape: Tape, random: np.random.Generator) -> None:
        """Two draws a reading: whether it is struck, and its new value."""
        struck = tape.readings.select(self.topic, self.source, self.windows)
        struck &= tape.readings.draw(self.topic, random.random) < self.p
        lowest, highest = self.span
        _tell(tape, self.topic, struck, lowest + (highest - lowest) * tape.readings.draw(self.topic, random.random))


def _tell(tape: Tape, topic: str, struck: Mask, value: Floats) -> None:
    """Write ``value`` where ``struck``, signal strengths in the steps of the log."""
    step_db = _resolution_db(tape) if topic == "wifi" else None
    tape.value[struck] = value[struck] if step_db is None else step_db * np.rint(value[struck] / step_db)


def _resolution_db(tape: Tape) -> float | None:
    """The coarsest of `RESOLUTIONS_DB` that all signal strengths of the log are whole multiples of."""
    strengths = tape.said_value[(tape.readings.topic == "wifi") & np.isfinite(tape.said_value)]
    return next((step for step in RESOLUTIONS_DB if np.allclose(np.rint(strengths / step), strengths / step)), None)
