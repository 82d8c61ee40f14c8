"""The moments at which a value was largest."""

from __future__ import annotations

import numpy as np

from benchmarks.metrics.track import Floats, Stamps
from fusion.values import nanoseconds

SPACING_S = 5.0
"""Moments closer together are one."""


def peaks(time_ns: Stamps, values: Floats, count: int) -> list[int]:
    """Indices of the ``count`` largest local maxima at least `SPACING_S` apart, the largest first, of equal ones the
    earliest; a plateau counts as its first row.
    """
    if len(values) == 0:
        return []
    starts = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))
    level = values[starts]
    above_left = np.concatenate([[True], level[1:] > level[:-1]])
    above_right = np.concatenate([level[:-1] > level[1:], [True]])
    chosen: list[int] = []
    candidates = starts[above_left & above_right]
    for place in candidates[np.argsort(-values[candidates], kind="stable")].tolist():
        if all(abs(int(time_ns[place]) - int(time_ns[other])) >= nanoseconds(SPACING_S) for other in chosen):
            chosen.append(place)
        if len(chosen) == count:
            break
    return chosen
