"""Row of the catalogue of metrics: each stands beside the function that computes it."""

from __future__ import annotations

import math
from enum import Enum, unique
from typing import NamedTuple


@unique
class Better(Enum):
    """The values of a metric that are better; ``NEITHER``: those near a certain value, as 1 is for ANEES."""

    LESS = "less"
    MORE = "more"
    NEITHER = "neither"


class Unit(NamedTuple):
    """The unit in which people read what is in an SI unit: its name, the factor to it, and decimals."""

    name: str
    factor: float
    decimals: int

    def number(self, value: object) -> str:
        """A value in the SI unit as a number of this one; – where there is none.

        >>> Unit("cm", 100.0, 1).number(0.123), Unit("", 1.0, 2).number(math.nan)
        ('12.3', '–')
        """
        if not isinstance(value, float) or math.isnan(value):
            return "–"
        return "∞" if math.isinf(value) else f"{value * self.factor:.{self.decimals}f}"


UNITS = {
    "m": Unit("cm", 100.0, 1),
    "m^2": Unit("cm²", 1e4, 0),
    "m/s": Unit("cm/s", 100.0, 2),
    "rad": Unit("°", math.degrees(1.0), 2),
    "s": Unit("s", 1.0, 2),
    "s/measurement": Unit("µs/msg", 1e6, 0),
    "1/min": Unit("1/min", 1.0, 2),
    "nat": Unit("nat", 1.0, 3),
    "share": Unit("%", 100.0, 1),
    "count": Unit("", 1.0, 0),
    "1": Unit("", 1.0, 2),
}
"""Units by the SI unit of a metric; a share is of 1, a count has no unit, 1 is a ratio."""


class Metric(NamedTuple):
    """Meaning of one number of a score. ``id``: its key in every record; ``si_unit``: one of `UNITS`; ``title``: its
    meaning, for the documentation; ``needs``: what a run or an estimator must have, or it is NaN or missing;
    ``signed``: it may be below zero, so that two of them have no ratio.
    """

    id: str
    si_unit: str
    better: Better
    title: str
    needs: str = "truth"
    signed: bool = False

    @property
    def unit(self) -> Unit:
        """The unit in which people read it."""
        return UNITS[self.si_unit]


def rows(
    ids: str, si_unit: str, better: Better, title: str, needs: str = "truth", *, signed: bool = False
) -> tuple[Metric, ...]:
    """Rows of several ``ids``, separated by spaces, that have all else in common."""
    return tuple(Metric(one, si_unit, better, title, needs, signed) for one in ids.split())
