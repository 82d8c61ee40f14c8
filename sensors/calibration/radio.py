"""Calibration of a radio: readings gathered by places, fitted by `line`, judged on places left out."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusion import LogError, World
from fusion.arrays import Flags, Floats, Whole
from fusion.quantiles import quantile
from fusion.radio import DistanceModel, PathLoss, RadioKind, Ranging
from logs.run import Run
from sensors.calibration.held_out import BeforeAfter, Interval, root_mean_square
from sensors.calibration.line import LEAST_PLACES, Estimate, Line, fit_line
from sensors.calibration.next_places import Advice, next_places
from sensors.calibration.place_medians import PlaceMedians, place_medians
from sensors.calibration.readings_by_place import KINDS, UNITS, Readings, gather

FOLDS = 5
LEAST_STD = 0.01
"""Of readings that agree perfectly, as a world must have it: more than zero."""


class AnchorFit(NamedTuple):
    """One anchor by itself: its places, its own gain and level, the scatter of its places, the share of the scans in
    which it was received. None of too few places.
    """

    places: int
    gain: Interval | None
    level: Interval | None
    place_std: float
    received: float


class RadioCalibration(NamedTuple):
    """Result for one kind of readings. ``std``: of one reading about the line, robust."""

    kind: RadioKind
    readings: Readings
    line: Line
    medians: PlaceMedians
    std: float
    anchors: dict[str, AnchorFit]
    scores: Sequence[BeforeAfter]
    advice: Sequence[Advice]


def kinds_in(runs: Sequence[Run]) -> list[RadioKind]:
    """The kinds of readings there are; raises `LogError` without any."""
    kinds = [kind for kind, values in KINDS.items() if any(isinstance(m, values) for r in runs for m in r.measurements)]
    if not kinds:
        raise LogError(f"{', '.join(str(run.path) for run in runs)}: holds no radio readings; record some")
    return kinds


def calibrate_radio(
    runs: Sequence[Run], kind: RadioKind, points: Path | None = None, place_m: float | None = None
) -> RadioCalibration:
    """Raises `LogError` without truth, without readings, with too few places or with all at one distance."""
    world = runs[0].world
    readings = gather(runs, kind, points, place_m)
    medians = place_medians(readings, _nominal_gain(world, kind))
    line = fit_line(medians, len(readings.names))
    return RadioCalibration(
        kind,
        readings,
        line,
        medians,
        math.hypot(medians.scatter, line.place_std),
        {name: _alone(medians, i, line, readings.received[name]) for i, name in enumerate(readings.names)},
        _scores(world, kind, readings),
        next_places(world, kind, readings, line),
    )


def _nominal_gain(world: World, kind: RadioKind) -> float:
    radio, ranging = world.anchors[0].radio, world.anchors[0].ranging
    return radio.path_loss_exponent if kind == "rssi" else ranging.scale


def _alone(medians: PlaceMedians, anchor: int, line: Line, received: float) -> AnchorFit:
    own = medians.at(medians.anchor == anchor)
    try:
        fit = fit_line(own, len(line.levels), (line.length_m, line.share))
    except LogError:
        return AnchorFit(len(own.value), None, None, math.nan, received)
    return AnchorFit(len(own.value), fit.gain_interval(), fit.level_interval(anchor), fit.place_std, received)


def calibrated(model: DistanceModel, gain: float, level: float) -> DistanceModel:
    """The world's model of an anchor with another gain and level."""
    if isinstance(model, PathLoss):
        return dataclasses.replace(model, path_loss_exponent=gain, reference_rssi_dbm=level)
    assert isinstance(model, Ranging)
    return dataclasses.replace(model, scale=gain, offset_m=level)


def _scores(world: World, kind: RadioKind, readings: Readings) -> list[BeforeAfter]:
    """Blocks of neighbouring places take turns to be left out, then every single place."""
    count = int(readings.place.max()) + 1
    before = _errors(world, kind, readings, None)
    unit, scores = UNITS[kind], list[BeforeAfter]()
    for what, folds in (("block of places", min(FOLDS, count)), ("place", count)):
        after = _left_out(world, kind, readings, readings.place * folds // count)
        if after is None:
            continue
        (was, was_m), (now, now_m) = before, after
        size = len(was)
        scores.append(
            BeforeAfter(f"{what} left out: reading, rms", unit, size, root_mean_square(was), root_mean_square(now))
        )
        for name, share in (("median", 0.5), ("p95", 0.95)):
            title = f"{what} left out: distance from one reading, {name}"
            scores.append(BeforeAfter(title, "m", size, *(quantile(np.abs(error), share) for error in (was_m, now_m))))
    return scores


def _left_out(world: World, kind: RadioKind, readings: Readings, fold: Whole) -> tuple[Floats, Floats] | None:
    """Errors of every reading by a line that was fitted without its fold; None where what is left is too poor."""
    errors = np.empty((2, len(fold)))
    for each in np.unique(fold):
        out: Flags = fold == each
        try:
            medians = place_medians(readings.at(~out), _nominal_gain(world, kind))
            line = Estimate.of(medians, len(readings.names))
        except LogError:
            return None
        errors[:, out] = _errors(world, kind, readings.at(out), line)
    return errors[0], errors[1]


def _errors(world: World, kind: RadioKind, readings: Readings, line: Estimate | None) -> tuple[Floats, Floats]:
    """Reading minus expected, and distance by the reading minus the true one [m], infinite where the line does not
    fall with distance; ``line`` None: by the world.
    """
    errors = np.empty((2, len(readings.value)))
    for i, anchor in enumerate(world.anchors):
        rows, model = readings.anchor == i, anchor.model(kind)
        if line is not None:
            level = line.level if math.isnan(line.levels[i]) else float(line.levels[i])
            model = calibrated(model, line.gain, level)
        errors[0, rows] = readings.value[rows] - model.expected(readings.distance_m[rows])
        away = model.distance(readings.value[rows]) if _gain(model) > 0.0 else np.inf
        errors[1, rows] = away - readings.distance_m[rows]
    return errors[0], errors[1]


def _gain(model: DistanceModel) -> float:
    return (
        model.path_loss_exponent if isinstance(model, PathLoss) else model.scale if isinstance(model, Ranging) else 0.0
    )


def changes(world: World, calibration: RadioCalibration) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Changes of ``[radio]`` or ``[ranging]``, and of anchors: their level, and keys they have themselves."""
    line, own = calibration.line, calibration.line.place_std
    gain_std = line.gain_interval().std
    std, bias = (
        max(calibration.std, LEAST_STD),
        max(math.hypot(own, line.level_std_between if _some_lack(calibration) else 0.0), 0.0),
    )
    if calibration.kind == "rssi":
        section, level, names = "radio", "reference_rssi_dbm", ("path_loss_exponent", "exponent_std")
        stds = {"shadowing_std_db": std, "bias_std_db": bias, "shadowing_length_m": line.length_m}
    else:
        section, level, names = "ranging", "offset_m", ("scale", "scale_std")
        stds = {"std_m": std, "bias_std_m": bias}
    pooled: dict[str, object] = {names[0]: line.gain, level: line.level, **stds, names[1]: gain_std}
    single: dict[str, dict[str, object]] = {}
    for row in json.loads(world.table)["anchors"]:
        mine = {key: value for key, value in pooled.items() if key in row.get(section, {})}
        fit = calibration.anchors[row["id"]]
        if fit.places >= LEAST_PLACES:
            mine[level] = float(line.levels[calibration.readings.names.index(row["id"])])
        single[row["id"]] = {section: mine} if mine else {}
    return {section: pooled}, single


def _some_lack(calibration: RadioCalibration) -> bool:
    return any(fit.places < LEAST_PLACES for fit in calibration.anchors.values())
