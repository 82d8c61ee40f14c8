"""Interpretations of the paper: all that it leaves open about its algorithm, as a grid over ``dynamic_weight``."""

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
"""Distances by which the floor is moved along both axes; None: until its middle is the origin."""


class Interpretation(NamedTuple):
    """One interpretation of the paper, as values of `OPTIONS`."""

    values: tuple[object, ...]

    @property
    def options(self) -> dict[str, object]:
        """As parameters of the estimator."""
        return dict(zip(OPTIONS, self.values, strict=True))

    @property
    def scale(self) -> str:
        """The quantity that the percentage is of."""
        return str(self.options[SCALE_OPTION])

    def __str__(self) -> str:
        relative_to, feedback, epsilon, raised = self.values
        return f"of {relative_to}, {'' if feedback else 'no '}feedback, epsilon {epsilon}, raised to {raised}"


INTERPRETATIONS = tuple(Interpretation(values) for values in itertools.product(*OPTIONS.values()))


def literal() -> Interpretation:
    """The interpretation of the estimator's defaults."""
    known = parameters(load(PROPOSED))
    return Interpretation(tuple(known[name].default for name in OPTIONS))
