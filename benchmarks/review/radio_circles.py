"""All radio readings of a run as columns, and the circle on the floor that each puts the robot on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import repeat
from operator import itemgetter
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fusion import Fate, Measurement, RangeReading, Ranges, WifiScan, World
from fusion.arrays import Floats, Stamps

Identity: TypeAlias = tuple[int, str, int, str]
"""Time [ns], sensor, sequence number and anchor: the identity of one reading in a run."""


class ReadingColumns(NamedTuple):
    """The readings in the order they came, all (n,): ``value`` [dBm] or, where ``is_range``, [m]. ``radius_of``:
    the radius [m] of the circle around the anchor on which a reading puts the robot, by the reading's identity; NaN for
    an anchor the world does not know.
    """

    time_ns: Stamps
    anchor: NDArray[np.str_]
    is_range: NDArray[np.bool_]
    value: Floats
    radius_of: Mapping[Identity, float]

    @classmethod
    def of_run(cls, world: World, measurements: Sequence[Measurement]) -> ReadingColumns:
        """Every radio reading among ``measurements``."""
        scans = [scan for scan in measurements if isinstance(scan, WifiScan | Ranges)]
        pairs = [(scan, reading) for scan in scans for reading in scan.readings]
        identity = [(scan.time_ns, scan.sensor, scan.seq, reading.anchor) for scan, reading in pairs]
        time_ns = np.array([entry[0] for entry in identity], dtype=np.int64)
        anchor = np.array([entry[3] for entry in identity], dtype=np.str_)
        is_range = np.array([isinstance(reading, RangeReading) for _, reading in pairs], dtype=np.bool_)
        value = np.array([reading.value for _, reading in pairs], dtype=np.float64)
        radius_m = _radii(world, anchor, is_range, value)
        return cls(time_ns, anchor, is_range, value, dict(zip(identity, radius_m.tolist(), strict=True)))

    def radii(self, fates: Sequence[Fate]) -> Floats:
        """The radius [m] of the reading of each of ``fates`` (m,); NaN for a reading that makes no circle."""
        radius_m = map(self.radius_of.get, map(itemgetter(slice(4)), fates), repeat(math.nan))
        return np.fromiter(radius_m, np.float64, len(fates))


def _radii(world: World, anchors: NDArray[np.str_], is_range: NDArray[np.bool_], value: Floats) -> Floats:
    """The inverse of each anchor's own model, less the height between the antennas; never less than zero."""
    radius_m = np.full(len(value), np.nan)
    for anchor in world.anchors:
        height_m = world.robot.antenna_m[2] - anchor.z
        for model, kind in ((anchor.ranging, is_range), (anchor.radio, ~is_range)):
            own = (anchors == anchor.id) & kind & np.isfinite(value)
            radius_m[own] = np.sqrt(np.maximum(model.distance(value[own]) ** 2 - height_m**2, 0.0))
    return radius_m
