"""A gyro's bias from standstills, its scale from turns, its noise from the Allan deviation.

    true rate = scale (measured - bias)

Samples within a standstill are one look at the bias, whatever their number, since the bias wanders: intervals
are made of standstills, and of blocks of samples only where there is a single one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fusion import LogError, ParameterError
from fusion.robot import Robot
from fusion.values import NANOSECONDS
from logs.run import Run
from sensors.calibration.allan import Allan, allan
from sensors.calibration.held_out import BeforeAfter, Interval, root_mean_square
from sensors.calibration.segments import find_segments
from sensors.calibration.standstills import LEAST_NS, Rates, Standstill, rates, samples, standstills, still
from sensors.calibration.wheels import Wheels, wheels

BLOCKS = 10
LEAST_TURN_RAD = 0.5
LEAST_TURNS = 6
"""To be halved and scored."""
MARK_STD_RAD = math.radians(2.0)
"""Of turns counted by a mark on the floor."""


class Turn(NamedTuple):
    """One turn: the truth's angle, the gyro's raw integral [rad], and its duration [s]."""

    true: float
    raw: float
    duration_s: float


class GyroCalibration(NamedTuple):
    """Result of a calibration. ``drift_rad_s``: standard deviation of the bias from one standstill to another, beyond
    the noise. ``trend``: its change per hour [rad/s / h]; both None of too few standstills. ``scale`` None: no turns.
    """

    bias: Interval
    standstills: Sequence[Standstill]
    drift_rad_s: float | None
    trend: Interval | None
    scale: Interval | None
    turns: Sequence[Turn]
    allan: Allan | None
    scores: Sequence[BeforeAfter]


def calibrate_gyro(runs: Sequence[Run], turns: float | None = None) -> GyroCalibration:
    """From all runs together. ``turns``: whole turns, left positive, from the first standstill of a single run to its
    last, in place of the truth. Raises `LogError` where there is no gyro, no wheels or no standstill.
    """
    if turns is not None and (len(runs) != 1 or turns == 0.0 or not math.isfinite(turns)):
        raise ParameterError(f"--turns {turns}: give the turns of a single run, left positive and not zero")
    gyros = [rates(run) for run in runs]
    sides = [wheels(run) for run in runs]
    stops = still([stop for i, pair in enumerate(zip(gyros, sides, strict=True)) for stop in standstills(*pair, i)])
    if not stops:
        raise LogError(
            f"{', '.join(str(run.path) for run in runs)}: no standstill of {LEAST_NS / NANOSECONDS:g} s or more; let "
            "the robot stand a minute before it drives"
        )
    bias = estimate_bias(stops, gyros)
    known = _marked(stops, gyros[0], turns) if turns is not None else _turns(runs, gyros, sides)
    scale = _scale(known, bias, turns is not None)
    return GyroCalibration(
        bias=bias,
        standstills=stops,
        drift_rad_s=_drift(stops),
        trend=_trend(stops),
        scale=scale,
        turns=known,
        allan=_allan(stops, gyros),
        scores=_scores(stops, known, runs[0].world.robot),
    )


def estimate_bias(stops: Sequence[Standstill], gyros: Sequence[Rates]) -> Interval:
    """The mean of the standstills, by Student's t over them; of one alone, over blocks of its samples."""
    if len(stops) > 1:
        biases = np.array([stop.bias for stop in stops])
        return Interval.of(float(biases.mean()), float(biases.std(ddof=1)) / math.sqrt(len(biases)), len(biases) - 1.0)
    blocks = [float(block.mean()) for block in np.array_split(samples(stops[0], gyros)[1], BLOCKS)]
    return Interval.of(stops[0].bias, float(np.std(blocks, ddof=1)) / math.sqrt(BLOCKS), BLOCKS - 1.0)


def _drift(stops: Sequence[Standstill]) -> float | None:
    """By the method of moments: the variance of the means, without what their noise explains; never below zero."""
    if len(stops) < 3:
        return None
    variance = float(np.var([stop.bias for stop in stops], ddof=1))
    return math.sqrt(max(variance - float(np.mean([stop.scatter**2 / stop.samples for stop in stops])), 0.0))


def _trend(stops: Sequence[Standstill]) -> Interval | None:
    """Least squares over the time of a single run [rad/s / h]."""
    from scipy.stats import linregress

    if len(stops) < 3 or len({stop.run for stop in stops}) > 1:
        return None
    hours = np.array([0.5 * (stop.from_ns + stop.until_ns) for stop in stops]) / NANOSECONDS / 3600.0
    line = linregress(hours - hours[0], np.array([stop.bias for stop in stops]))
    return Interval.of(float(line.slope), float(line.stderr), len(stops) - 2.0)


def _turns(runs: Sequence[Run], gyros: Sequence[Rates], sides: Sequence[Wheels]) -> list[Turn]:
    """Every piece of a run that turned enough, by a truth that has headings of its own."""
    pieces = []
    for i, (run, own, side) in enumerate(zip(runs, gyros, sides, strict=True)):
        if run.truth is None or len(run.truth) < 2:
            continue
        for piece in find_segments(run, i, side):
            if abs(piece.turn_rad) >= LEAST_TURN_RAD and own.covers(piece.from_ns, piece.until_ns):
                duration_s = (piece.until_ns - piece.from_ns) / NANOSECONDS
                pieces.append(Turn(piece.turn_rad, own.turned(piece.from_ns, piece.until_ns), duration_s))
    return pieces


def _marked(stops: Sequence[Standstill], gyro: Rates, turns: float) -> list[Turn]:
    """From the middle of the first standstill to the middle of the last."""
    begin, end = ((stop.from_ns + stop.until_ns) // 2 for stop in (stops[0], stops[-1]))
    if begin == end:
        raise LogError("--turns needs a standstill before the turns and one after them; let the robot stand a while")
    return [Turn(math.tau * turns, gyro.turned(begin, end), (end - begin) / NANOSECONDS)]


def _scale(turns: Sequence[Turn], bias: Interval, marked: bool) -> Interval | None:
    """Least squares through the origin, true over measured without bias; of marked turns, by the mark's own noise."""
    if not turns or (len(turns) < 3 and not marked):
        return None
    true, raw, duration_s = (np.array(column) for column in zip(*turns, strict=True))
    measured = raw - bias.value * duration_s
    weight = float(measured @ measured)
    if weight == 0.0:
        raise LogError("the gyro measured no turn at all where the robot turned; check its axis and its driver")
    scale = float(measured @ true) / weight
    by_bias = scale * float(measured @ duration_s) / weight * bias.std
    freedom = math.inf if marked else len(turns) - 1.0
    left = (
        math.sqrt(2.0) * MARK_STD_RAD
        if marked
        else math.sqrt(float(np.square(true - scale * measured).sum()) / freedom)
    )
    return Interval.of(scale, math.hypot(left / math.sqrt(weight), by_bias), min(freedom, 1e6))


def _allan(stops: Sequence[Standstill], gyros: Sequence[Rates]) -> Allan | None:
    """Of the longest standstill, taken as evenly sampled."""
    longest = max(stops, key=lambda stop: stop.until_ns - stop.from_ns)
    time_ns, rate = samples(longest, gyros)
    return allan(rate, float(np.median(np.diff(time_ns))) / NANOSECONDS)


def _scores(stops: Sequence[Standstill], turns: Sequence[Turn], robot: Robot) -> list[BeforeAfter]:
    """Each standstill by the mean of all others; odd turns by even ones and even by odd, the bias by all stops."""
    biases = np.array([stop.bias for stop in stops])
    scores = []
    if len(stops) > 1:
        others = (biases.sum() - biases) / (len(biases) - 1)
        was, now = root_mean_square(biases - robot.gyro_bias_rad_s), root_mean_square(biases - others)
        scores.append(BeforeAfter("rate at rest", "°/s", len(stops), math.degrees(was), math.degrees(now)))
    if len(turns) >= LEAST_TURNS:
        bias = Interval(float(biases.mean()), 0.0, 0.0)
        errors = [_left(turn, robot.gyro_scale, robot.gyro_bias_rad_s) for turn in turns], list[float]()
        for half, other in ((0, 1), (1, 0)):
            scale = _scale(turns[other::2], bias, marked=False)
            errors[1].extend(_left(turn, 1.0 if scale is None else scale.value, bias.value) for turn in turns[half::2])
        was, now = (math.degrees(root_mean_square(np.array(each))) for each in errors)
        scores.append(BeforeAfter("turn of a piece", "°", len(turns), was, now))
    return scores


def _left(turn: Turn, scale: float, bias: float) -> float:
    """True minus measured angle [rad]."""
    return turn.true - scale * (turn.raw - bias * turn.duration_s)
