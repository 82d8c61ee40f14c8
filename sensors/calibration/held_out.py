"""Errors before and after, of data that were not fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusion.arrays import Floats
from fusion.output.tables import Table


class Interval(NamedTuple):
    """A number, its standard deviation, and half the width of its 95 % interval."""

    value: float
    std: float
    reach: float

    @classmethod
    def of(cls, value: float, std: float, freedom: float) -> Interval:
        """Student's t with ``freedom`` degrees; without any, everything is possible."""
        from scipy.special import stdtrit

        return cls(value, std, float(stdtrit(freedom, 0.975)) * std if freedom > 0.0 else math.inf)

    def holds(self, value: float) -> bool:
        """Whether the interval has it."""
        return abs(value - self.value) <= self.reach

    def text(self, decimals: int) -> str:
        """For people.

        >>> Interval(2.0, 0.1, 0.2).text(1)
        '2.0 ± 0.2'
        """
        reach = f"{self.reach:.{decimals}f}" if math.isfinite(self.reach) else "∞"
        return f"{self.value:.{decimals}f} ± {reach}"


class BeforeAfter(NamedTuple):
    """One score of the held-out parts: by the world as it was, and as calibrated on the other parts."""

    what: str
    unit: str
    samples: int
    before: float
    after: float


def root_mean_square(errors: Floats) -> float:
    """NaN of none."""
    return float(np.sqrt(np.mean(np.square(errors)))) if len(errors) else math.nan


def table(title: str, scores: Sequence[BeforeAfter]) -> Table:
    """As a table, with the share of each error that is left."""
    rows = tuple(
        (f"{score.what}, {score.unit}", str(score.samples), f"{score.before:.4g}", f"{score.after:.4g}", _left(score))
        for score in scores
    )
    return Table(title, ("held-out error", "samples", "before", "after", "left %"), rows)


def _left(score: BeforeAfter) -> str:
    """A dash where there was nothing to improve."""
    left = 100.0 * score.after / score.before if score.before > 0.0 else math.inf
    return f"{left:.0f}" if left < 1000.0 else "–"


def record(value: object) -> object:
    """Content of a calibration as strict JSON: named tuples by their names, numbers that are not finite as None."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {key: record(item) for key, item in value._asdict().items()}
    if isinstance(value, dict):
        return {str(key): record(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [record(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
