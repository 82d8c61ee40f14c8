"""Radio readings with the distance they were taken at, gathered by places.

Shadowing belongs to the place: a thousand readings in one spot measure it no better than ten. Readings are therefore
gathered into places, discs of the floor in the order of the first visit, and a place counts once for each anchor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusion import LogError, Pose, Ranges, RssiReading, WifiScan, World
from fusion.arrays import Flags, Floats, Whole
from fusion.radio import RadioKind
from fusion.world import Anchor
from logs.importers.foreign_recording import read_table
from logs.prior import begin_ns
from logs.run import Run
from logs.truth import Instants, interpolate_truth, known_truth
from sensors.calibration.segments import GAP_S

KINDS: dict[RadioKind, type[WifiScan] | type[Ranges]] = {"rssi": WifiScan, "range": Ranges}
UNITS: dict[RadioKind, str] = {"rssi": "dB", "range": "m"}
PLACE_M, PLACES_ACROSS = 1.0, 16
"""Radius of a place, or this part of a smaller floor; doubled until there are at most `MOST_PLACES`."""
MOST_PLACES = 200


COLUMNS = ("anchor", "value", "distance_m", "gain", "x", "y", "place")
"""Those of `Readings`, one row for each reading."""


class Readings(NamedTuple):
    """Columns (n,) in the order of time: index into ``names``, its value [dBm or m], the distance between both
    antennas [m], the model's gain (`DistanceModel.by_gain`) there, where the robot was [m], and its place, from 0.

    ``received``: share of the scans at known places in which each anchor was received.
    """

    names: tuple[str, ...]
    anchor: Whole
    value: Floats
    distance_m: Floats
    gain: Floats
    x: Floats
    y: Floats
    place: Whole
    place_m: float
    received: dict[str, float]

    def at(self, rows: Flags) -> Readings:
        """Some of them."""
        return self._replace(**{key: getattr(self, key)[rows] for key in COLUMNS})


def gather(runs: Sequence[Run], kind: RadioKind, points: Path | None = None, place_m: float | None = None) -> Readings:
    """All readings of a kind that were taken where the truth, or a survey in ``points``, knows the robot to be.

    Raises `LogError` where there are none.
    """
    world = runs[0].world
    names = tuple(anchor.id for anchor in world.anchors)
    rows, scans = list[tuple[int, float, float, float, float, float]](), 0
    for run in runs:
        messages = [m for m in run.measurements if isinstance(m, KINDS[kind])]
        where = _surveyed(points, run) if points is not None else _truth(run)
        scans += sum(where(np.array([scan.time_ns]))[1][0] for scan in messages)
        rows += _rows(world, kind, messages, where)
    if not rows:
        raise LogError(
            f"{', '.join(str(run.path) for run in runs)}: no {kind} readings of the world's anchors at a known place; "
            "record the truth with them, or stand at surveyed points and give --points FILE"
        )
    anchor, value, distance, gain, x, y = (np.array(column) for column in zip(*rows, strict=True))
    place, radius = places(x, y, place_m)
    counts = np.bincount(anchor, minlength=len(names)) / max(scans, 1)
    received = {name: float(count) for name, count in zip(names, counts, strict=True)}
    return Readings(names, anchor, value, distance, gain, x, y, place, radius, received)


class _Where:
    """Known positions of the robot: poses at times, and whether each is known."""

    def __init__(self, known: Instants, spans: list[tuple[int, int]] | None = None) -> None:
        self._known, self._spans = known, spans

    def __call__(self, time_ns: Whole) -> tuple[Instants, Flags]:
        known = self._known
        if self._spans is not None:
            row = np.array([self._span(int(time)) for time in time_ns])
            return known.at(np.maximum(row, 0)), row >= 0
        inside = (time_ns >= known.time_ns[0]) & (time_ns <= known.time_ns[-1])
        poses, kept = interpolate_truth(known, np.clip(time_ns, known.time_ns[0], known.time_ns[-1]), gap_s=GAP_S)
        return poses, inside & kept

    def _span(self, time_ns: int) -> int:
        assert self._spans is not None
        return next((i for i, (begin, end) in enumerate(self._spans) if begin <= time_ns <= end), -1)


def _truth(run: Run) -> _Where:
    known = None if run.truth is None else known_truth(run.truth)
    if known is None or len(known.time_ns) < 2:
        raise LogError(
            f"{run.path}: holds no ground truth; record it, or stand at surveyed points and give --points FILE"
        )
    return _Where(known)


def _surveyed(path: Path, run: Run) -> _Where:
    """A CSV file with the columns from_s, until_s [s since the run's start], x_m and y_m."""
    start = begin_ns(run.measurements)
    spans, x, y = list[tuple[int, int]](), list[float](), list[float]()
    for row in read_table(path, ("from_s", "until_s", "x_m", "y_m")):
        spans.append((start + row.time_ns("from_s"), start + row.time_ns("until_s")))
        x.append(row.number("x_m"))
        y.append(row.number("y_m"))
        if spans[-1][1] <= spans[-1][0] or not (math.isfinite(x[-1]) and math.isfinite(y[-1])):
            raise LogError(f"{row.place}: give until_s after from_s, and a finite place; correct it")
    if not spans:
        raise LogError(f"{path}: holds no points; give a row for every place the robot stood at")
    begins = np.array([begin for begin, _ in spans], dtype=np.int64)
    return _Where(Instants(begins, np.array(x), np.array(y), np.full(len(x), np.nan)), spans)


def _rows(
    world: World, kind: RadioKind, messages: Sequence[WifiScan | Ranges], where: _Where
) -> Iterator[tuple[int, float, float, float, float, float]]:
    """Anchor, value, distance, gain, x and y of every finite reading of a known anchor at a known place."""
    index = {anchor.id: i for i, anchor in enumerate(world.anchors)}
    readings = [(scan.time_ns, reading) for scan in messages for reading in scan.readings if reading.anchor in index]
    taken = [time - reading.age_ns if isinstance(reading, RssiReading) else time for time, reading in readings]
    if not taken:
        return
    poses, known = where(np.array(taken, dtype=np.int64))
    for i, (_, reading) in enumerate(readings):
        if known[i] and math.isfinite(reading.value):
            anchor = world.anchors[index[reading.anchor]]
            x, y = float(poses.x[i]), float(poses.y[i])
            away = distance_m(Pose(x, y, float(poses.heading[i])), anchor, world.robot.antenna_m)
            yield index[anchor.id], reading.value, away, float(anchor.model(kind).by_gain(away)), x, y


def distance_m(base: Pose, anchor: Anchor, antenna_m: tuple[float, float, float]) -> float:
    """Between both antennas. Without a heading the robot's own counts as above the middle of the robot."""
    forward, left, up = antenna_m
    x, y = (base.x, base.y) if math.isnan(base.heading) else base.transform(forward, left)
    return math.dist((x, y, up), (anchor.x, anchor.y, anchor.z))


def places(x: Floats, y: Floats, radius_m: float | None = None) -> tuple[Whole, float]:
    """The place of each position (n,) and the radius [m]: the first place within it, or else a new one there.

    In the order of time, so neighbours in number are neighbours on the path; turning the floor changes nothing.
    """
    radius = min(PLACE_M, max(extent_m(x, y) / PLACES_ACROSS, 0.01)) if radius_m is None else radius_m
    while True:
        place = _leaders(x, y, radius)
        if radius_m is not None or place.max(initial=0) < MOST_PLACES:
            return place, radius
        radius *= 2.0


def extent_m(x: Floats, y: Floats) -> float:
    """Diameter [m] of the disc about the mean position that holds all: the same however the floor is turned."""
    return 2.0 * float(np.hypot(x - x.mean(), y - y.mean()).max())


def _leaders(x: Floats, y: Floats, radius_m: float) -> Whole:
    centres, place = np.empty((2, 0)), np.empty(len(x), dtype=np.int64)
    for i, here in enumerate(zip(x, y, strict=True)):
        away = np.hypot(centres[0] - here[0], centres[1] - here[1])
        near = np.flatnonzero(away <= radius_m)
        if len(near) == 0:
            centres = np.column_stack([centres, here])
            near = np.array([centres.shape[1] - 1])
        place[i] = near[0]
    return place
