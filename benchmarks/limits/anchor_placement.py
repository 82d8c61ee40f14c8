"""Placement of anchors: the least error of a fix all over the floor, and the changes that lower it most.

The criterion is the 95th percentile over the floor of `benchmarks.metrics.bound.fix_error`: a place where the bound is
undefined counts as an infinite error. Every anchor is taken to be received everywhere; walls do not enter.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.limits.fix_bound import (
    AS_STATED,
    Places,
    Shared,
    anchor_information,
    fix_covariance,
    root_trace,
)
from fusion import Anchor, Bounds, World
from fusion.arrays import Floats
from fusion.output.progress import Progress
from fusion.quantiles import quantile
from fusion.radio import PathLoss, RadioKind, Ranging
from fusion.schema import read_record
from fusion.trilateration import are_collinear

MOST_CELLS = 4000
"""Cells of the floor by default, at most."""
MOST_CANDIDATES = 1600
"""Places tried for an anchor, at most."""
TAIL = 0.95
NEW = "new"


class Readings(NamedTuple):
    """Readings of a fix: ``scans`` readings of every anchor, all of one kind, from one place."""

    radio: RadioKind
    scans: int = 1
    shared: Shared = AS_STATED


class Grid(NamedTuple):
    """Middles of the floor's cells: x (nx,), y (ny,) [m]."""

    x: Floats
    y: Floats

    @classmethod
    def over(cls, bounds: Bounds, step_m: float) -> Grid:
        """Equal cells of about ``step_m``, at least one each way."""
        return cls(_middles(bounds.x_min, bounds.x_max, step_m), _middles(bounds.y_min, bounds.y_max, step_m))

    def places(self, height: float) -> Places:
        """The antenna at ``height`` over every cell, (ny, nx)."""
        x, y = np.meshgrid(self.x, self.y)
        return Places(x, y, height)


def _middles(low: float, high: float, step_m: float) -> Floats:
    count = max(1, round((high - low) / step_m))
    return np.asarray(low + (high - low) * (np.arange(count) + 0.5) / count)


def default_step(bounds: Bounds, most: int = MOST_CELLS) -> float:
    """The smallest of ... 0.1, 0.2, 0.5, 1, 2, 5 ... m that cuts the floor into ``most`` cells at most.

    >>> default_step(Bounds(0.0, 12.0, 0.0, 9.0))
    0.2
    """
    wide, deep = bounds.x_max - bounds.x_min, bounds.y_max - bounds.y_min
    # A corridor has at least one cell across it, so its length alone may set the step.
    least = max(math.sqrt(wide * deep / most), max(wide, deep) / most)
    decade = 10.0 ** math.floor(math.log10(least))
    return next(round(factor * decade, 12) for factor in (1, 2, 5, 10) if factor * decade >= least)


class Spread(NamedTuple):
    """Errors over the floor [m], undefined counted as infinite, and the share of the floor where they are."""

    median_m: float
    p95_m: float
    worst_m: float
    undefined: float

    @classmethod
    def of(cls, error_m: Floats) -> Spread:
        """Of a map of errors, NaN where undefined."""
        flat = np.where(np.isnan(error_m), np.inf, error_m).ravel()
        return cls(quantile(flat, 0.5), quantile(flat, TAIL), float(flat.max()), float(np.isinf(flat).mean()))


class Proposal(NamedTuple):
    """An anchor in a new place: one more (`NEW`), or one moved. ``spread``: the errors with it."""

    anchor: Anchor
    spread: Spread


def error_map(anchors: Sequence[Anchor], readings: Readings, places: Places) -> Floats:
    """The least error of a fix at ``places`` (...) [m]; NaN where undefined."""
    return _error(_information(anchors, readings, places).sum(axis=0), readings)


def _information(anchors: Sequence[Anchor], readings: Readings, places: Places) -> Floats:
    return anchor_information(anchors, places, readings.radio, scans=readings.scans, shared=readings.shared)


def _error(information: Floats, readings: Readings) -> Floats:
    return root_trace(fix_covariance(information, readings.shared))


def losses(anchors: Sequence[Anchor], readings: Readings, places: Places) -> dict[str, Spread]:
    """The errors that are left when one anchor falls silent, by its id."""
    information = _information(anchors, readings, places)
    return {
        anchor.id: Spread.of(_error(np.delete(information, i, axis=0).sum(axis=0), readings))
        for i, anchor in enumerate(anchors)
    }


def new_anchor(world: World) -> Anchor:
    """One more anchor as the world's own tables describe it, as high as the others (their median)."""
    table = json.loads(world.table)
    height = float(np.median([anchor.z for anchor in world.anchors]))
    radio = read_record(PathLoss, table.get("radio", {}), "radio")
    ranging = read_record(Ranging, table.get("ranging", {}), "ranging")
    return Anchor(NEW, math.nan, math.nan, height, radio, ranging)


def best_addition(
    world: World, readings: Readings, places: Places, progress: Progress | None = None
) -> Proposal | None:
    """One more anchor where it lowers the criterion most; None where it lowers it nowhere on the floor."""
    return _best(world, readings, places, [new_anchor(world)], progress)


def best_move(world: World, readings: Readings, places: Places, progress: Progress | None = None) -> Proposal | None:
    """The best move of one anchor, its height kept; None where no move lowers the criterion."""
    return _best(world, readings, places, world.anchors, progress)


def _best(
    world: World, readings: Readings, places: Places, movable: Sequence[Anchor], progress: Progress | None
) -> Proposal | None:
    """The place of the first lowest criterion among all candidates for all ``movable`` anchors."""
    best, lowest = None, Spread.of(error_map(world.anchors, readings, places)).p95_m
    for done, anchor in enumerate(movable):
        others = [other for other in world.anchors if other.id != anchor.id]
        rest = _information(others, readings, places).sum(axis=0)
        for place in _candidates(world.bounds, anchor, others):
            spread = Spread.of(_error(rest + _information((place,), readings, places)[0], readings))
            if spread.p95_m < lowest:
                best, lowest = Proposal(place, spread), spread.p95_m
        if progress is not None:
            progress(done + 1, len(movable), anchor.id)
    return best


def _candidates(bounds: Bounds, anchor: Anchor, others: Sequence[Anchor]) -> Iterator[Anchor]:
    """``anchor`` all over the floor, its edges included, but nowhere that a world file would be refused for."""
    step_m = default_step(bounds, MOST_CANDIDATES)
    columns, rows = _nodes(bounds.x_min, bounds.x_max, step_m), _nodes(bounds.y_min, bounds.y_max, step_m)
    fixed = [(other.x, other.y) for other in others]
    for y in rows.tolist():
        for x in columns.tolist():
            taken = (x, y, anchor.z) in {(other.x, other.y, other.z) for other in others}
            if not taken and (len(others) < 2 or not are_collinear(np.array([*fixed, (x, y)]))):
                yield replace(anchor, x=x, y=y)


def _nodes(low: float, high: float, step_m: float) -> Floats:
    return np.linspace(low, high, max(1, round((high - low) / step_m)) + 1)
