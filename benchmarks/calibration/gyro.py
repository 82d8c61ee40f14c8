"""A gyro's bias from standstills, its scale from turns, its noise from the Allan deviation.

    true rate = scale (measured - bias)

A standstill is told by the wheels: no roll of either side. It is left out where the gyro itself says that the robot was
moved. Samples within a standstill are one look at the bias, whatever their number, since the bias wanders: intervals
are made of standstills, and of blocks of samples only where there is a single one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.calibration.allan import Allan, allan
from benchmarks.calibration.held_out import BeforeAfter, Interval, root_mean_square
from benchmarks.calibration.segments import find_segments
from benchmarks.calibration.wheels import Wheels, wheels
from benchmarks.metrics.track import Floats, Whole
from fusion import Gyro, LogError, ParameterError
from fusion.values import NANOSECONDS, nanoseconds
from fusion.world import Robot
from logs.run import Run

LEAST_NS = nanoseconds(1.0)
"""A shorter standstill says little."""
MARGIN_NS = nanoseconds(0.2)
"""Left out at both ends: wheels tick only some time after the robot has begun to move."""
LEAST_SAMPLES = 10
MOVED = 4.0
"""Scatter over the median scatter of all standstills, from which on one was none."""
BLOCKS = 10
LEAST_TURN_RAD = 0.5
LEAST_TURNS = 6
"""To be halved and scored."""
MARK_STD_RAD = math.radians(2.0)
"""Of turns counted by a mark on the floor."""


class Rates(NamedTuple):
    """A run's gyro in time order (n,): time [ns] and raw rate [rad/s]; ``angle`` its integral by the trapezoid rule."""

    time_ns: Whole
    rate: Floats
    angle: Floats

    def turned(self, from_ns: int, until_ns: int) -> float:
        """Raw angle [rad] between two times."""
        begin, end = np.interp([from_ns, until_ns], self.time_ns, self.angle)
        return float(end - begin)

    def covers(self, from_ns: int, until_ns: int) -> bool:
        """Whether it measured from one time to another."""
        return bool(self.time_ns[0] <= from_ns and until_ns <= self.time_ns[-1])


class Standstill(NamedTuple):
    """One stop of run number ``run``: from when to when, the mean raw rate and the scatter about it [rad/s]."""

    run: int
    from_ns: int
    until_ns: int
    samples: int
    bias: float
    scatter: float


class Turn(NamedTuple):
    """One turn: the truth's angle, the gyro's raw integral [rad], and how long it took [s]."""

    true: float
    raw: float
    duration_s: float


class GyroCalibration(NamedTuple):
    """Everything that was found. ``drift_rad_s``: standard deviation of the bias from one standstill to another, beyond
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


def rates(run: Run) -> Rates:
    """Raises `LogError` where a run has no gyro."""
    told = sorted(
        (m.time_ns, m.rate_rad_s) for m in run.measurements if isinstance(m, Gyro) and math.isfinite(m.rate_rad_s)
    )
    if len(told) < 2:
        raise LogError(f"{run.path}: holds no gyro; record one with turn_source or driver for it")
    time_ns, first = np.unique(np.array([time for time, _ in told], dtype=np.int64), return_index=True)
    rate = np.array([rate for _, rate in told])[first]
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_ns) / NANOSECONDS
    return Rates(time_ns, rate, np.concatenate([[0.0], np.cumsum(steps)]))


def standstills(told: Rates, rolled: Wheels, number: int) -> list[Standstill]:
    """The stops of one run that are long enough."""
    moving = (np.diff(rolled.left) != 0.0) | (np.diff(rolled.right) != 0.0) | (np.diff(rolled.lost) > 0)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]]).astype(int)))
    found = []
    for begin, end in zip(rolled.time_ns[edges[0::2]], rolled.time_ns[edges[1::2]], strict=True):
        inside = (told.time_ns >= begin + MARGIN_NS) & (told.time_ns <= end - MARGIN_NS)
        if end - begin >= LEAST_NS and inside.sum() >= LEAST_SAMPLES:
            rate = told.rate[inside]
            found.append(
                Standstill(number, int(begin), int(end), len(rate), float(rate.mean()), float(rate.std(ddof=1)))
            )
    return found


def still(found: Sequence[Standstill]) -> list[Standstill]:
    """Without those in which the robot was moved: carried, or turned on slipping wheels."""
    usual = float(np.median([each.scatter for each in found])) if found else 0.0
    middle = float(np.median([each.bias for each in found])) if found else 0.0
    limit = max(MOVED * usual, 1e-9)
    return [each for each in found if each.scatter <= limit and abs(each.bias - middle) <= limit]


def calibrate_gyro(runs: Sequence[Run], turns: float | None = None) -> GyroCalibration:
    """From all runs together. ``turns``: whole turns, left positive, from the first standstill of a single run to its
    last, in place of the truth. Raises `LogError` where there is no gyro, no wheels or no standstill.
    """
    if turns is not None and (len(runs) != 1 or turns == 0.0 or not math.isfinite(turns)):
        raise ParameterError(f"--turns {turns}: give the turns of a single run, left positive and not zero")
    told = [rates(run) for run in runs]
    rolled = [wheels(run) for run in runs]
    stops = still([stop for i, pair in enumerate(zip(told, rolled, strict=True)) for stop in standstills(*pair, i)])
    if not stops:
        raise LogError(
            f"{', '.join(str(run.path) for run in runs)}: no standstill of {LEAST_NS / NANOSECONDS:g} s or more; let "
            "the robot stand a minute before it drives"
        )
    bias = estimate_bias(stops, told)
    known = _marked(stops, told[0], turns) if turns is not None else _turns(runs, told, rolled)
    scale = _scale(known, bias, turns is not None)
    return GyroCalibration(
        bias=bias,
        standstills=stops,
        drift_rad_s=_drift(stops),
        trend=_trend(stops),
        scale=scale,
        turns=known,
        allan=_allan(stops, told),
        scores=_scores(stops, known, runs[0].world.robot),
    )


def estimate_bias(stops: Sequence[Standstill], told: Sequence[Rates]) -> Interval:
    """The mean of the standstills, by Student's t over them; of one alone, over blocks of its samples."""
    if len(stops) > 1:
        biases = np.array([stop.bias for stop in stops])
        return Interval.of(float(biases.mean()), float(biases.std(ddof=1)) / math.sqrt(len(biases)), len(biases) - 1.0)
    blocks = [float(block.mean()) for block in np.array_split(_samples(stops[0], told), BLOCKS)]
    return Interval.of(stops[0].bias, float(np.std(blocks, ddof=1)) / math.sqrt(BLOCKS), BLOCKS - 1.0)


def _samples(stop: Standstill, told: Sequence[Rates]) -> Floats:
    own = told[stop.run]
    return own.rate[(own.time_ns >= stop.from_ns + MARGIN_NS) & (own.time_ns <= stop.until_ns - MARGIN_NS)]


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
    found = linregress(hours - hours[0], np.array([stop.bias for stop in stops]))
    return Interval.of(float(found.slope), float(found.stderr), len(stops) - 2.0)


def _turns(runs: Sequence[Run], told: Sequence[Rates], rolled: Sequence[Wheels]) -> list[Turn]:
    """Every piece of a run that turned enough, by a truth that has headings of its own."""
    found = []
    for i, (run, own, side) in enumerate(zip(runs, told, rolled, strict=True)):
        if run.truth is None or len(run.truth) < 2:
            continue
        for piece in find_segments(run, i, side):
            if abs(piece.turn_rad) >= LEAST_TURN_RAD and own.covers(piece.from_ns, piece.until_ns):
                duration_s = (piece.until_ns - piece.from_ns) / NANOSECONDS
                found.append(Turn(piece.turn_rad, own.turned(piece.from_ns, piece.until_ns), duration_s))
    return found


def _marked(stops: Sequence[Standstill], told: Rates, turns: float) -> list[Turn]:
    """From the middle of the first standstill to the middle of the last."""
    begin, end = ((stop.from_ns + stop.until_ns) // 2 for stop in (stops[0], stops[-1]))
    if begin == end:
        raise LogError("--turns needs a standstill before the turns and one after them; let the robot stand a while")
    return [Turn(math.tau * turns, told.turned(begin, end), (end - begin) / NANOSECONDS)]


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


def _allan(stops: Sequence[Standstill], told: Sequence[Rates]) -> Allan | None:
    """Of the longest standstill, taken as evenly sampled."""
    longest = max(stops, key=lambda stop: stop.until_ns - stop.from_ns)
    own = told[longest.run]
    inside = (own.time_ns >= longest.from_ns + MARGIN_NS) & (own.time_ns <= longest.until_ns - MARGIN_NS)
    return allan(own.rate[inside], float(np.median(np.diff(own.time_ns[inside]))) / NANOSECONDS)


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
