"""Causes of an error just before a moment: the growth of the error, and the readings that misled.

A filter has no truth and calls a reading surprising by its own belief, right or wrong. Here every reading is compared
with the world's model at the true place: that shows the anchor that misled, and the gate that erred.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from benchmarks.limits.fix_bound import Places
from benchmarks.metrics.matching import MAX_AGE_S
from fusion import Anchor, Decision, RangeReading, Ranges, Reason, RssiReading, Update, WifiScan, World
from fusion.arrays import Floats
from logs.truth import Instants, interpolate_truth

MISLEADING = 1.0
"""Standard deviations by which an anchor's readings are off, on average, from which they count as misleading."""
OUTLIER = 3.0
"""Standard deviations from which a single reading is worth a word, where all together were right."""


class Growth(NamedTuple):
    """The error [m] at the beginning of a span, and how much the scans in it added, and all between them."""

    before_m: float
    scans_m: float
    between_m: float


class Misreading(NamedTuple):
    """Readings of one anchor that were all taken, or all not, on average: how much farther [m] than it was they put it,
    and how many standard deviations of one reading they were off, either way, by the noise that the world states.
    ``alone``: it is the one outlier among others that were right.
    """

    anchor: str
    taken: bool
    farther_m: float
    sigmas: float
    alone: bool = False


def growth(updates: Sequence[Update], truth: Instants) -> Growth | None:
    """Change of the position error over ``updates`` in time order; None where fewer than two can be judged."""
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


def misreadings(world: World, updates: Sequence[Update], truth: Instants) -> Iterator[Misreading]:
    """Of each anchor whose readings were judged in ``updates``, in the order of their first reading."""
    off = _readings_off(world, updates, truth)
    for (anchor, taken), rows in off.items():
        farther_m, sigmas = np.mean(rows, axis=0).tolist()
        alone_m, alone_sigmas = max(rows, key=lambda row: abs(row[1]))
        if abs(sigmas) < MISLEADING and abs(alone_sigmas) >= OUTLIER:
            yield Misreading(anchor, taken, alone_m, abs(alone_sigmas), alone=True)
        else:
            yield Misreading(anchor, taken, farther_m, abs(sigmas))


def _readings_off(
    world: World, updates: Sequence[Update], truth: Instants
) -> Mapping[tuple[str, bool], list[tuple[float, float]]]:
    """By anchor and whether they were taken: how far off each reading was, see `_off`."""
    scans = [(u.measurement, u.fates) for u in updates if isinstance(u.measurement, WifiScan | Ranges)]
    x, y, heading = _truth_at(truth, [scan.time_ns for scan, _ in scans]).T
    # A heading that is not known misplaces an antenna by its distance from the robot's middle at most.
    places = Places.of_poses(world, x, y, np.nan_to_num(heading))
    anchors = {anchor.id: anchor for anchor in world.anchors}
    residuals: dict[tuple[str, bool], list[tuple[float, float]]] = {}
    for i, (scan, fates) in enumerate(scans):
        readings = {reading.anchor: reading for reading in scan.readings}
        judged = [fate for fate in fates if fate.reason is not Reason.KIND_NOT_CONSUMED]
        for fate in (fate for fate in judged if fate.anchor in anchors and fate.anchor in readings):
            off = _off(anchors[fate.anchor], readings[fate.anchor], places, i)
            if math.isfinite(off[1]):
                taken = fate.decision in (Decision.USED, Decision.DOWNWEIGHTED)
                residuals.setdefault((fate.anchor, taken), []).append(off)
    return residuals


def _off(anchor: Anchor, reading: RssiReading | RangeReading, places: Places, i: int) -> tuple[float, float]:
    """Excess distance [m] of a reading over the ``i``-th place, and its residual in standard deviations."""
    is_range = isinstance(reading, RangeReading)
    model, value = anchor.model("range" if is_range else "rssi"), reading[1]
    offset = (places.x[i] - anchor.x, places.y[i] - anchor.y, places.height - anchor.z)
    distance_m = math.hypot(*offset)
    std = math.hypot(model.std, model.bias_std, model.gain_std * float(model.by_gain(distance_m)))
    off = (value - float(model.expected(distance_m))) / std if std > 0.0 else math.nan
    return float(model.distance(value)) - distance_m, off


def _truth_at(truth: Instants, time_ns: Sequence[int]) -> Floats:
    """True x, y [m] and heading [rad] (n, 3); NaN before, after, and in gaps of the truth."""
    stamps, poses = np.array(time_ns, dtype=np.int64), np.full((len(time_ns), 3), np.nan)
    if len(truth) >= 2:
        inside = np.flatnonzero((stamps >= truth.time_ns[0]) & (stamps <= truth.time_ns[-1]))
        at, kept = interpolate_truth(truth, stamps[inside], gap_s=MAX_AGE_S)
        poses[inside[kept]] = np.column_stack([at.x, at.y, at.heading])[kept]
    return poses
