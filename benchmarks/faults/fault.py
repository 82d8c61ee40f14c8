"""The base of every kind of fault: options that are checked, and one change of a run.

Options are checked by their names, which carry their units; a kind may check more.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from benchmarks.faults.row_selection import Windows
from benchmarks.faults.run_columns import RunColumns
from fusion import ParameterError
from fusion.errors import did_you_mean


@dataclass(frozen=True, slots=True)
class Fault(ABC):
    """One fault; raises `ParameterError` for options that mean nothing."""

    kind: ClassVar[str]
    topics: ClassVar[tuple[str, ...]] = ()
    """Those that ``topic`` may be, for the kinds that have it."""

    @abstractmethod
    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """Write the fault into ``columns``. Raises `ParameterError` for a topic or source that the run does not have.

        Draws its random numbers for all rows of a topic at once, the same many whatever its options.
        """

    def __post_init__(self) -> None:
        for name, value in self.options().items():
            for names, allows, wanted in CHECKS:
                if name in names and value is not None and not allows(value):
                    raise ParameterError(f"{name}: {value!r} must {wanted}")
        topic = self.options().get("topic")
        if isinstance(topic, str) and topic not in self.topics:
            raise ParameterError(
                f"topic {topic!r} cannot have the fault {self.kind}; {did_you_mean(topic, self.topics)}"
            )

    def options(self) -> dict[str, object]:
        """All options by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def place(self) -> str:
        """Topic, source and other words among its options, but no numbers: the name of its random stream."""
        return "/".join([self.kind, *(value for value in self.options().values() if isinstance(value, str))])

    @property
    def lasts(self) -> Windows:
        """Windows in which it acts; empty for one that lasts the whole run, or never acts."""
        windows: Windows | None = getattr(self, "windows", None)
        return windows or ()


def _are_windows(windows: Windows) -> bool:
    return all(0.0 <= begin < end for begin, end in windows)


CHECKS: tuple[tuple[tuple[str, ...], Callable[[Any], bool], str], ...] = (
    (("p", "p_enter", "p_exit"), lambda share: 0.0 <= share <= 1.0, "be a probability, from 0 to 1"),
    (
        ("std_db", "std_m", "std_deg", "mean", "mean_s", "jitter_s", "factor", "from_s", "until_s"),
        lambda number: number >= 0.0,
        "not be negative",
    ),
    (("windows",), _are_windows, "be stretches [begin, end] in seconds from the run's start, the end after the begin"),
    (("span",), lambda span: span[0] < span[1], "be [lowest, highest]"),
)
"""Names of options, the values that are allowed, and the words for that."""
