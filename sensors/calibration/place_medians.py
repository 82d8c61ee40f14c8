"""Readings of one anchor at one place as one number, to which a radio calibration is fitted."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion.arrays import Flags, Floats, Whole
from sensors.calibration.readings_by_place import Readings

NORMAL = 1.4826
"""Standard deviation over median absolute deviation of a Gaussian."""


class PlaceMedians(NamedTuple):
    """One row (n,) for each anchor and place: columns as in `Readings`, ``size``: its number of readings.

    ``scatter``: standard deviation of single readings about their own median, robust, in the reading's unit.
    """

    anchor: Whole
    place: Whole
    value: Floats
    gain: Floats
    x: Floats
    y: Floats
    size: Whole
    scatter: float

    def at(self, rows: Flags) -> PlaceMedians:
        """Some of them; the scatter stays."""
        return self._replace(**{key: each[rows] for key, each in self._asdict().items() if key != "scatter"})


def place_medians(readings: Readings, slope: float) -> PlaceMedians:
    """Readings of one anchor at one place together: medians about a line of ``slope``, at their mean gain."""
    key = readings.anchor * (int(readings.place.max()) + 1) + readings.place
    _, first, row, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(row, kind="stable")
    groups = np.split(order, np.cumsum(count)[:-1])
    level = readings.value - slope * readings.gain
    middle = np.array([np.median(level[group]) for group in groups])
    gain, x, y = (
        np.array([column[group].mean() for group in groups]) for column in (readings.gain, readings.x, readings.y)
    )
    left = np.abs(level - middle[row])[count[row] > 1]
    fair = math.sqrt(float(count[count > 1].sum()) / max(float((count[count > 1] - 1).sum()), 1.0))
    scatter = NORMAL * fair * float(np.median(left)) if len(left) else 0.0
    anchor, place = readings.anchor[first], readings.place[first]
    return PlaceMedians(anchor, place, middle + slope * gain, gain, x, y, count, scatter)
