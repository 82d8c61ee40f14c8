"""Faults of radio readings: noise, a changed transmit power, obstructed links, wild readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from benchmarks.faults.fault import Fault
from benchmarks.faults.row_selection import Windows
from benchmarks.faults.run_columns import RunColumns
from fusion.arrays import Flags, Floats

RADIO_TOPICS = ("ranges", "wifi")
RESOLUTIONS_DB = (1.0, 0.5, 0.1)
"""Steps in which receivers report signal strengths; a log that keeps to none of them is not rounded."""


@dataclass(frozen=True, slots=True)
class RssiNoise(Fault):
    """More Gaussian noise on signal strengths [dB], rounded as the log is."""

    kind: ClassVar[str] = "rssi_noise"
    std_db: float
    source: str = ""
    windows: Windows | None = None

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """One draw a reading."""
        noisy = columns.readings.select("wifi", self.source, self.windows)
        noise = self.std_db * columns.readings.draw("wifi", random.standard_normal)
        _write(columns, "wifi", noisy, columns.value + noise)


@dataclass(frozen=True, slots=True)
class PowerStep(Fault):
    """An anchor's transmit power changes by ``step_db`` for good, ``from_s`` after the run's start."""

    kind: ClassVar[str] = "power_step"
    source: str
    step_db: float
    from_s: float = 0.0

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:  # noqa: ARG002 - no chance in it
        """Shift the readings after the step."""
        columns.value[columns.readings.select("wifi", self.source, ((self.from_s, np.inf),))] += self.step_db

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

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """Two draws a reading: whether it is changed, and how far."""
        changed = columns.readings.select(self.topic, self.source, self.windows)
        changed &= columns.readings.draw(self.topic, random.random) < self.p
        excess = self.mean * columns.readings.draw(self.topic, random.standard_exponential)
        _write(columns, self.topic, changed, columns.value + (excess if self.topic == "ranges" else -excess))


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

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """Two draws a reading: whether it is changed, and its new value."""
        changed = columns.readings.select(self.topic, self.source, self.windows)
        changed &= columns.readings.draw(self.topic, random.random) < self.p
        lowest, highest = self.span
        _write(
            columns, self.topic, changed, lowest + (highest - lowest) * columns.readings.draw(self.topic, random.random)
        )


def _write(columns: RunColumns, topic: str, changed: Flags, value: Floats) -> None:
    """Write ``value`` where ``changed``, signal strengths in the steps of the log."""
    step_db = _resolution_db(columns) if topic == "wifi" else None
    columns.value[changed] = value[changed] if step_db is None else step_db * np.rint(value[changed] / step_db)


def _resolution_db(columns: RunColumns) -> float | None:
    """The coarsest of `RESOLUTIONS_DB` that all signal strengths of the log are whole multiples of."""
    strengths = columns.recorded_value[(columns.readings.topic == "wifi") & np.isfinite(columns.recorded_value)]
    return next((step for step in RESOLUTIONS_DB if np.allclose(np.rint(strengths / step), strengths / step)), None)
