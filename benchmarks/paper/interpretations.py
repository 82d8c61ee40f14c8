"""What the paper leaves open about its algorithm, as one grid over the named options of ``dynamic_weight``."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import NamedTuple

from benchmarks.paper.published import PROPOSED
from fusion import load
from fusion.plugins import parameters

SCALE_OPTION = "outlier_relative_to"
SCALES = ("coordinate", "position", "travelled", "floor")
OPTIONS: Mapping[str, tuple[object, ...]] = {
    SCALE_OPTION: SCALES,
    "feedback": (True, False),
    "epsilon": (1, 3, 5),
    "raised_weight": (0.6, 0.75, 1.0),
}
"""Every combination is run. How missing Wi-Fi counts cannot matter here, since every scan gives a fix; it is tried on
runs with missing access points."""
MISSING_OPTION = "missing_wifi"
MISSING_VALUES = ("ignore", "count")
ORIGINS_M: tuple[float | None, ...] = (None, 0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""How far the floor is moved along both axes; None: until its middle is the origin."""


class Reading(NamedTuple):
    """One way to read the paper."""

    values: tuple[object, ...]

    @property
    def options(self) -> dict[str, object]:
        """As parameters of the estimator."""
        return dict(zip(OPTIONS, self.values, strict=True))

    @property
    def scale(self) -> str:
        """What the percentage is of."""
        return str(self.options[SCALE_OPTION])

    def __str__(self) -> str:
        relative_to, feedback, epsilon, raised = self.values
        return f"of {relative_to}, {'' if feedback else 'no '}feedback, epsilon {epsilon}, raised to {raised}"


READINGS = tuple(Reading(values) for values in itertools.product(*OPTIONS.values()))


def literal() -> Reading:
    """The reading that the estimator's defaults are."""
    known = parameters(load(PROPOSED))
    return Reading(tuple(known[name].default for name in OPTIONS))
