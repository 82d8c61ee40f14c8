"""Pieces of a drive whose true length or turn is known: segments in a log by its truth, or measured with a tape.

Straight lines determine the wheels' scale, turns the effective track and, both senses together, the larger side. The
truth alone decides where a piece begins and ends; the wheels' measurement of it is judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusion import LogError
from fusion.arrays import Floats, Whole
from fusion.values import nanoseconds
from logs.importers.foreign_recording import read_table
from logs.prior import begin_ns
from logs.run import Run
from logs.truth import Instants, evaluation_instants
from sensors.calibration.wheels import Wheels

WINDOW_S = 0.6
"""Speed and turn rate are differences over this time."""
STANDING_M_S = 0.04
TURNING_RAD_S = 0.15
SPIN_RADIUS_M = 0.1
STRAIGHT_RADIUS_M = 2.5
"""A tighter turn is an arc, a much tighter one a spin on the spot."""
LEAST_S = 0.5
LEAST_M = 0.25
LEAST_RAD = 0.5
"""Less drowns in the truth's own noise."""
STRAIGHT_RAD = 0.35
"""A piece that turns more altogether is an arc, however wide."""
COURSE_M = 0.5
"""Where the truth has no heading, straight pieces at least this long give it by their direction."""
EXTEND_S = 0.4
"""A turn is taken this much longer at both ends, to where it is over: cut in full swing, it would be as wrong as the
clocks of truth and sensor differ."""
GAP_S = 1.5
"""Where the truth is silent for longer, the motion of the robot is unknown."""
STANDING, STRAIGHT, SPIN, ARC, TURN = "standing", "straight", "spin", "arc", "turn"
"""Kinds of motion; a turn is whatever was driven between two straight pieces."""


class Segment(NamedTuple):
    """One piece of run number ``run``: how far its end is from its beginning [m] and how far the robot turned [rad, not
    wrapped, left positive], NaN where not known.
    """

    run: int
    kind: str
    from_ns: int
    until_ns: int
    distance_m: float
    turn_rad: float


def find_segments(run: Run, number: int, wheels: Wheels) -> list[Segment]:
    """The straight pieces, spins and arcs of a run, by its truth; raises `LogError` where it has none.

    Without headings in the truth, the turn from the middle of one straight piece to the middle of the next is known by
    their directions; of the turns that differ by a whole one, the nearest to the wheels' own is taken.
    """
    if run.truth is None or len(run.truth) < 2:
        raise LogError(f"{run.path}: holds no ground truth; record it, or measure with a tape and give --segments FILE")
    truth = evaluation_instants(run.truth)
    track_m = run.world.robot.track_width_m
    headed = bool(np.isfinite(truth.heading).mean() > 0.5)
    kinds = _kinds(truth, _headings(truth) if headed else (wheels.time_ns, (wheels.right - wheels.left) / track_m))
    pieces = [
        Piece(kind, first, last)
        for kind, first, last in _pieces(truth, kinds)
        if wheels.covers(int(truth.time_ns[first]), int(truth.time_ns[last]))
    ]
    if headed:
        segments = [_with_heading(truth, number, piece) for piece in pieces]
        return [each for each in segments if each.distance_m >= LEAST_M or abs(each.turn_rad) >= LEAST_RAD]
    return list(_by_course(truth, number, pieces, wheels, track_m))


class Piece(NamedTuple):
    """A stretch of one kind of motion, from its first to its last instant."""

    kind: str
    first: int
    last: int


def _headings(truth: Instants) -> tuple[Whole, Floats]:
    """Times and headings that are known, unwrapped."""
    known = np.isfinite(truth.heading)
    return truth.time_ns[known], np.unwrap(truth.heading[known])


def _kinds(truth: Instants, angles: tuple[Whole, Floats]) -> list[str]:
    """Kind of motion at each instant, by differences over `WINDOW_S` of its place and of ``angles`` in time."""
    half = nanoseconds(0.5 * WINDOW_S)
    begins, ends = truth.time_ns - half, truth.time_ns + half
    moved = [np.interp(ends, truth.time_ns, c) - np.interp(begins, truth.time_ns, c) for c in (truth.x, truth.y)]
    speeds = np.hypot(*moved) / WINDOW_S
    rates = np.abs(np.interp(ends, *angles) - np.interp(begins, *angles)) / WINDOW_S
    return [_kind(float(speed), float(rate)) for speed, rate in zip(speeds, rates, strict=True)]


def _kind(speed_m_s: float, rate_rad_s: float) -> str:
    if speed_m_s < STANDING_M_S and rate_rad_s < TURNING_RAD_S:
        return STANDING
    if speed_m_s < SPIN_RADIUS_M * rate_rad_s:
        return SPIN
    return STRAIGHT if speed_m_s > STRAIGHT_RADIUS_M * rate_rad_s else ARC


def _pieces(truth: Instants, kinds: list[str]) -> Iterator[Piece]:
    """Stretches of one kind that are long enough, with no gap in them; standing still is none."""
    begin = 0
    for i in range(1, len(kinds) + 1):
        is_next = i < len(kinds) and truth.time_ns[i] - truth.time_ns[i - 1] <= nanoseconds(GAP_S)
        if is_next and kinds[i] == kinds[begin]:
            continue
        lasts_ns = truth.time_ns[i - 1] - truth.time_ns[begin]
        if kinds[begin] != STANDING and lasts_ns >= nanoseconds(LEAST_S):
            piece = Piece(kinds[begin], begin, i - 1)
            yield piece if piece.kind == STRAIGHT else _extended(truth, piece)
        begin = i


def _extended(truth: Instants, piece: Piece) -> Piece:
    """To the outermost instants that are known within the time it is extended by."""
    reach = nanoseconds(EXTEND_S)
    first = int(np.searchsorted(truth.time_ns, truth.time_ns[piece.first] - reach))
    last = int(np.searchsorted(truth.time_ns, truth.time_ns[piece.last] + reach, side="right")) - 1
    return Piece(piece.kind, first, last)


def _chord_m(truth: Instants, piece: Piece) -> float:
    dx, dy = truth.x[piece.last] - truth.x[piece.first], truth.y[piece.last] - truth.y[piece.first]
    return float(math.hypot(dx, dy))


def _with_heading(truth: Instants, number: int, piece: Piece) -> Segment:
    """Lengths of straight pieces only: a spin goes nowhere, and the chord of an arc depends on its turn. A heading
    that is missing at an end leaves the turn unknown, and missing for longer, what was driven.
    """
    heading, time_ns = truth.heading[piece.first : piece.last + 1], truth.time_ns[piece.first : piece.last + 1]
    is_known = np.isfinite(heading)
    known_ns = np.concatenate([time_ns[:1], time_ns[is_known], time_ns[-1:]])
    if np.diff(known_ns).max() > nanoseconds(GAP_S):
        return Segment(number, piece.kind, int(time_ns[0]), int(time_ns[-1]), math.nan, math.nan)
    known = np.unwrap(heading[is_known])
    turn = float(known[-1] - known[0]) if is_known[[0, -1]].all() else math.nan
    kind = ARC if piece.kind == STRAIGHT and abs(turn) > STRAIGHT_RAD else piece.kind
    distance = _chord_m(truth, piece) if kind == STRAIGHT else math.nan
    return Segment(number, kind, int(truth.time_ns[piece.first]), int(truth.time_ns[piece.last]), distance, turn)


def _by_course(truth: Instants, number: int, pieces: list[Piece], wheels: Wheels, track_m: float) -> Iterator[Segment]:
    """Straight pieces, and the turns between their middles; one driven backwards heads against its direction."""
    before: tuple[int, float] | None = None
    for piece in pieces:
        if piece.kind != STRAIGHT or (chord := _chord_m(truth, piece)) < COURSE_M:
            continue
        begin, end = int(truth.time_ns[piece.first]), int(truth.time_ns[piece.last])
        left, right = wheels.between(begin, end)
        if abs(float(right.sum() - left.sum())) > STRAIGHT_RAD * track_m:
            continue
        yield Segment(number, STRAIGHT, begin, end, chord, math.nan)
        back = math.pi if float(left.sum() + right.sum()) < 0.0 else 0.0
        dx, dy = truth.x[piece.last] - truth.x[piece.first], truth.y[piece.last] - truth.y[piece.first]
        middle, course = (begin + end) // 2, math.atan2(dy, dx) + back
        if before is not None and wheels.covers(before[0], middle):
            left, right = wheels.between(before[0], middle)
            rolled = float(right.sum() - left.sum()) / track_m
            turn = rolled + math.remainder(course - before[1] - rolled, math.tau)
            yield Segment(number, TURN, before[0], middle, math.nan, turn)
        before = middle, course


def read_segments(path: Path, run: Run, number: int) -> list[Segment]:
    """Segments measured by hand: a CSV file with the columns from_s, until_s [s since the run's start],
    distance_m (end from beginning) and turn_rad (whole turns counted, left positive), either of them may be empty.
    """
    start = begin_ns(run.measurements)
    segments = []
    for row in read_table(path, ("from_s", "until_s", "distance_m", "turn_rad")):
        begin, end = start + row.time_ns("from_s"), start + row.time_ns("until_s")
        distance, turn = (row.number(key) if row.text(key) else math.nan for key in ("distance_m", "turn_rad"))
        if end <= begin or math.isinf(distance) or math.isinf(turn) or (math.isnan(distance) and math.isnan(turn)):
            raise LogError(f"{row.place}: give until_s after from_s, and a finite distance_m or turn_rad; correct it")
        kind = SPIN if math.isnan(distance) else STRAIGHT if math.isnan(turn) or abs(turn) < LEAST_RAD else ARC
        segments.append(Segment(number, kind, begin, end, distance, turn))
    return segments
