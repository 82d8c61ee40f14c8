"""A fault: a radio that rounds what it measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from benchmarks.faults.fault import Fault
from benchmarks.faults.run_columns import RunColumns
from fusion import ParameterError


@dataclass(frozen=True, slots=True)
class Quantise(Fault):
    """Readings are rounded to whole steps [dBm or m]."""

    kind: ClassVar[str] = "quantise"
    topics: ClassVar[tuple[str, ...]] = ("ranges", "wifi")
    topic: str
    step: float

    def __post_init__(self) -> None:
        Fault.__post_init__(self)
        if self.step <= 0.0:
            raise ParameterError(f"step: {self.step!r} must be positive")

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:  # noqa: ARG002 - draws nothing
        """Write the rounded readings."""
        rows = columns.readings.select(self.topic, "")
        columns.value[rows] = np.round(columns.value[rows] / self.step) * self.step
