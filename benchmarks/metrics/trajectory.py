"""How well the answers follow the truth from one time to a later one: relative pose errors, speed, jumps, length."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.deviation import Errors
from benchmarks.metrics.quantiles import mean, quantile, root_mean_square
from benchmarks.metrics.track import Floats, Whole
from fusion.values import NANOSECONDS, nanoseconds

DISTANCES_M = (1, 5, 10)
DURATIONS_S = (1, 5, 10)
SPEED_WINDOW_S = 1.0
LONGEST = 1.5
"""A pair whose ends lie further apart than this many times what was asked, as across a gap, is none."""
ROUNDING_M = 1e-9
"""A path is that much longer than its sum of floating-point steps says: whole steps then end where they should."""
TOP_SPEED_M_S = 2.0
"""What no indoor robot exceeds, where none is declared."""
JUMP_M = 0.10
APART = 1e6
"""Between two runs lies that much path [m] and time [s]: no pair reaches over."""

Points = NDArray[np.complex128]
Pairs = tuple[slice | Whole, slice | Whole]
"""Indices of the instants where each pair starts and ends."""


def trajectory_metrics(measured: Errors, *, top_speed_m_s: float = TOP_SPEED_M_S) -> dict[str, float]:
    """All of this module."""
    return {
        **relative_pose_metrics(measured),
        **velocity_metrics(measured),
        **step_metrics(measured, top_speed_m_s),
    }


def relative_pose_metrics(measured: Errors) -> dict[str, float]:
    """``rpe_d_1m_rmse`` ... ``rpe_t_10s_rot_median``: RMSE and median of translation [m] and ``rot``ation [rad].

    From every instant to the first one after at least 1, 5, 10 m of *true* path, or 1, 5, 10 s; ``n`` pairs with an
    answer at both ends (Sturm et al. 2012; Geiger et al. 2012; Zhang & Scaramuzza 2018).
    """
    poses, path_m, clock_ns = Poses.of(measured), _path_m(measured), _clock_ns(measured)
    pairs = {f"rpe_d_{reach}m": ahead(path_m, reach - ROUNDING_M) for reach in DISTANCES_M}
    pairs |= {f"rpe_t_{reach}s": later(clock_ns, nanoseconds(reach)) for reach in DURATIONS_S}
    scores: dict[str, float] = {}
    for name, (start, end) in pairs.items():
        scores |= _summary(name, *relative_errors(poses, start, end))
    return scores


def _summary(name: str, translation: Floats, rotation: Floats) -> dict[str, float]:
    unanswered = np.isnan(translation)
    if unanswered.any():
        translation, rotation = translation[~unanswered], rotation[~unanswered]
    return {
        f"{name}_n": float(len(translation)),
        f"{name}_rmse": root_mean_square(translation),
        f"{name}_median": quantile(translation, 0.5),
        f"{name}_rot_rmse": root_mean_square(rotation),
        f"{name}_rot_median": quantile(rotation, 0.5),
    }


def ahead(along: Floats | Whole, reach: float) -> Pairs:
    """Each index and the first one whose ``along`` (n,), which never falls, is at least ``reach`` more."""
    end = np.searchsorted(along, along + reach)
    count = int(np.searchsorted(end, len(along)))
    end = end[:count]
    near = along[end] - along[:count] <= LONGEST * reach
    return (slice(count), end) if near.all() else (np.flatnonzero(near), end[near])


def later(clock_ns: Whole, reach_ns: int) -> Pairs:
    """`ahead` of times: at an even rate, as most instants come, the pairs are plain slices and cost nothing."""
    steps = np.diff(clock_ns)
    if len(steps) == 0 or steps.min() != steps.max() or steps[0] > (LONGEST - 1.0) * reach_ns:
        return ahead(clock_ns, reach_ns)
    count = -(-reach_ns // int(steps[0]))
    return slice(max(len(clock_ns) - count, 0)), slice(count, None)


class Poses(NamedTuple):
    """What relative errors are computed from, (n,): points [m] as complex numbers, the answers' heading error [rad],
    the rotation that takes it back, and the answer's point so rotated minus the true one.
    """

    true: Points
    said: Points
    turn: Floats
    back: Points
    beside: Points

    @classmethod
    def of(cls, measured: Errors) -> Poses:
        """Those of all instants; NaN where there is no answer."""
        true = measured.x + 1j * measured.y
        said = true + (measured.dx + 1j * measured.dy)
        back = np.cos(measured.turn) - 1j * np.sin(measured.turn)
        return cls(true, said, measured.turn, back, said * back - true)


def relative_errors(poses: Poses, start: slice | Whole, end: slice | Whole) -> tuple[Floats, Floats]:
    """Size of translation [m] and rotation [rad] of E = (T_i⁻¹ T_j)⁻¹ (T̂_i⁻¹ T̂_j) in SE(2) for k pairs (i, j), (k,);
    NaN where an end has no answer.

    Turning E by the true heading at i leaves its size: what remains is the answer's step, turned back by the heading
    error at i, minus the true step.
    """
    moved = poses.said[end] * poses.back[start]
    moved -= poses.true[end]
    moved -= poses.beside[start]
    turned = poses.turn[end] - poses.turn[start]
    return np.abs(moved), np.abs(turned - 2.0 * np.pi * np.rint(turned * (0.5 / np.pi)))


def velocity_metrics(measured: Errors) -> dict[str, float]:
    """Size of the difference between the mean velocities over 1 s of answers and truth [m/s]: mean and p95."""
    clock_ns = _clock_ns(measured)
    start, end = later(clock_ns, nanoseconds(SPEED_WINDOW_S))
    error = measured.dx + 1j * measured.dy
    gained = np.abs(error[end] - error[start])
    speed = gained / ((clock_ns[end] - clock_ns[start]) / NANOSECONDS)
    known = speed[~np.isnan(speed)]
    return {"vel_err": mean(known), "vel_err_p95": quantile(known, 0.95)}


def step_metrics(measured: Errors, top_speed_m_s: float = TOP_SPEED_M_S) -> dict[str, float]:
    """From one answered instant to the next: jumps per minute, and the answers' path over the true one.

    A jump is a step longer than ``top_speed_m_s`` allows in the time between the stamps of both answers, plus 0.10 m.
    """
    if len(measured.time_ns) == 0:
        return {"jump_rate": math.nan, "path_ratio": math.nan}
    moved = np.diff(measured.x + 1j * measured.y)
    step = np.abs(moved + np.diff(measured.dx + 1j * measured.dy))
    seconds = np.diff(measured.time_ns) / NANOSECONDS
    stamped = seconds - np.diff(np.where(np.isfinite(measured.age_s), measured.age_s, 0.0))
    both = np.isfinite(step) & (np.diff(measured.run) == 0)
    jumps = step[both] > top_speed_m_s * stamped[both] + JUMP_M
    minutes, length = float(seconds[both].sum()) / 60.0, float(np.abs(moved)[both].sum())
    return {
        "jump_rate": float(np.count_nonzero(jumps)) / minutes if minutes else math.nan,
        "path_ratio": float(step[both].sum()) / length if length else math.nan,
    }


def _path_m(measured: Errors) -> Floats:
    """True path length up to each instant (n,) [m]."""
    steps = np.abs(np.diff(measured.x + 1j * measured.y))
    steps[np.diff(measured.run) != 0] = APART
    return np.concatenate([np.zeros(min(len(measured.x), 1)), np.cumsum(steps)])


def _clock_ns(measured: Errors) -> Whole:
    """Time since the first instant (n,), the runs one after the other."""
    steps = np.diff(measured.time_ns)
    steps[np.diff(measured.run) != 0] = nanoseconds(APART)
    return np.concatenate([np.zeros(min(len(measured.x), 1), dtype=np.int64), np.cumsum(steps)])
