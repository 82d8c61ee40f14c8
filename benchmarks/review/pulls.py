"""What pulled an estimate off the truth just before a moment: how its error grew, and which readings said so.

A filter sees no truth and calls a reading surprising by its own belief, right or wrong. Here every reading is held
against what the world's model gives for the true place: that tells the anchor that misled, and the gate that erred.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.bound import Places, model_of
from benchmarks.metrics.course import Instants
from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.instants import MAX_AGE_S, interpolate_truth
from benchmarks.metrics.track import Floats
from fusion import Anchor, Decision, RangeReading, Ranges, RssiReading, Update, WifiScan, World


class Growth(NamedTuple):
    """The error [m] at the beginning of a span, and how much the scans in it added, and all between them."""

    before_m: float
    scans_m: float
    between_m: float


class Misreading(NamedTuple):
    """Readings of one anchor, on average: how much farther [m] than it was they put it, how many standard deviations of
    one reading they were off, either way, by all that the world says of noise, and the share of them that was taken.
    """

    anchor: str
    farther_m: float
    sigmas: float
    taken: float


def growth(updates: Sequence[Update], truth: Instants) -> Growth | None:
    """How the position error changed over ``updates`` in time order; None where fewer than two can be judged."""
    place_m = _truth_at(truth, [update.estimate.time_ns for update in updates])
    errors_m = [
        math.hypot(x - update.estimate.pose.x, y - update.estimate.pose.y) if update.estimate.valid else math.nan
        for update, (x, y, _) in zip(updates, place_m.tolist(), strict=True)
    ]
    judged = [i for i, error in enumerate(errors_m) if math.isfinite(error)]
    if len(judged) < 2:
        return None
    steps = [
        (isinstance(updates[b].measurement, WifiScan | Ranges), errors_m[b] - errors_m[a]) for a, b in pairwise(judged)
    ]
    scans_m, between_m = (sum(step for of_scan, step in steps if of_scan is wanted) for wanted in (True, False))
    return Growth(errors_m[judged[0]], scans_m, between_m)


def misreadings(world: World, updates: Sequence[Update], fates: FateColumns, truth: Instants) -> Iterator[Misreading]:
    """Of each anchor that was heard in ``updates``, whose last word are ``fates``, in the order of the world."""
    scans = [update.measurement for update in updates if isinstance(update.measurement, WifiScan | Ranges)]
    x, y, heading = _truth_at(truth, [scan.time_ns for scan in scans]).T
    # A heading that is not known misplaces an antenna by its distance from the robot's middle at most.
    places = Places.of_poses(world, x, y, np.nan_to_num(heading))
    for anchor in world.anchors:
        heard = [
            (i, reading) for i, scan in enumerate(scans) for reading in scan.readings if reading.anchor == anchor.id
        ]
        off = np.array([_off(anchor, reading, places, i) for i, reading in heard]).reshape(-1, 2)
        off = off[np.isfinite(off).all(axis=1)]
        if len(off):
            farther_m, sigmas = off.mean(axis=0).tolist()
            yield Misreading(anchor.id, farther_m, abs(sigmas), _taken(fates, anchor.id))


def _off(anchor: Anchor, reading: RssiReading | RangeReading, places: Places, i: int) -> tuple[float, float]:
    """How much farther [m] than the ``i``-th place a reading is, and how many standard deviations above its due."""
    is_range = isinstance(reading, RangeReading)
    model, value = model_of(anchor, "range" if is_range else "rssi"), reading[1]
    offset = (places.x[i] - anchor.x, places.y[i] - anchor.y, places.height - anchor.z)
    distance_m = math.hypot(*offset)
    std = math.hypot(model.std, model.bias_std, model.gain_std * float(model.by_gain(distance_m)))
    off = (value - float(model.expected(distance_m))) / std if std > 0.0 else math.nan
    return float(model.distance(value)) - distance_m, off


def _taken(fates: FateColumns, anchor: str) -> float:
    own = fates.names[fates.anchor] == anchor
    return float(fates.met(Decision.USED, Decision.DOWNWEIGHTED)[own].mean()) if own.any() else 0.0


def _truth_at(truth: Instants, time_ns: Sequence[int]) -> Floats:
    """True x, y [m] and heading [rad] (n, 3); NaN before, after, and in gaps of the truth."""
    stamps, found = np.array(time_ns, dtype=np.int64), np.full((len(time_ns), 3), np.nan)
    if len(truth) >= 2:
        inside = np.flatnonzero((stamps >= truth.time_ns[0]) & (stamps <= truth.time_ns[-1]))
        at, kept = interpolate_truth(truth, stamps[inside], gap_s=MAX_AGE_S)
        found[inside[kept]] = np.column_stack([at.x, at.y, at.heading])[kept]
    return found
