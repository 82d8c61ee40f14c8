"""How well the answers follow the truth from one time to a later one: relative pose errors, speed, jumps, length."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.deviation import Errors
from benchmarks.metrics.quantiles import mean, quantile, quantiles, root_mean_squares
from benchmarks.metrics.track import Flags, Floats, Whole
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
    poses = Poses.of(measured)
    return {
        **relative_pose_metrics(poses),
        **velocity_metrics(poses),
        **step_metrics(poses, measured.age_s, top_speed_m_s),
    }


def relative_pose_metrics(poses: Poses) -> dict[str, float]:
    """``rpe_d_1m_rmse`` ... ``rpe_t_10s_rot_median``: RMSE and median of translation [m] and ``rot``ation [rad].

    From every instant to the first one after at least 1, 5, 10 m of *true* path, or 1, 5, 10 s; ``n`` pairs with a
    whole pose at both ends (Sturm et al. 2012; Geiger et al. 2012; Zhang & Scaramuzza 2018).
    """
    pairs = {f"rpe_d_{reach}m": ahead(poses.path_m, reach - ROUNDING_M) for reach in DISTANCES_M}
    period_ns = poses.period_ns
    pairs |= {f"rpe_t_{reach}s": later(poses.clock_ns, nanoseconds(reach), period_ns) for reach in DURATIONS_S}
    whole = not np.isnan(poses.turn).any()
    scores: dict[str, float] = {}
    for name, (start, end) in pairs.items():
        found = relative_errors(poses, start, end)
        scores |= _summary(name, found if whole else found[:, ~np.isnan(found).any(axis=0)])
    return scores


def _summary(name: str, found: Floats) -> dict[str, float]:
    rmse, rotation_rmse = root_mean_squares(found)
    median, rotation_median = quantiles(found, 0.5)
    return {
        f"{name}_n": float(found.shape[1]),
        f"{name}_rmse": rmse,
        f"{name}_median": median,
        f"{name}_rot_rmse": rotation_rmse,
        f"{name}_rot_median": rotation_median,
    }


def ahead(along: Floats | Whole, reach: float) -> Pairs:
    """Each index and the first one whose ``along`` (n,), which never falls, is at least ``reach`` more."""
    end = np.searchsorted(along, along + reach)
    count = int(np.searchsorted(end, len(along)))
    end = end[:count]
    near = along[end] - along[:count] <= LONGEST * reach
    return (slice(count), end) if near.all() else (np.flatnonzero(near), end[near])


def later(clock_ns: Whole, reach_ns: int, period_ns: int) -> Pairs:
    """`ahead` of times: where they come every ``period_ns``, the pairs are plain slices and cost nothing."""
    if not 0 < period_ns <= (LONGEST - 1.0) * reach_ns:
        return ahead(clock_ns, reach_ns)
    count = -(-reach_ns // period_ns)
    return slice(max(len(clock_ns) - count, 0)), slice(count, None)


class Poses(NamedTuple):
    """What every metric of this module is computed from, (n,), the runs one after the other.

    Points [m] are complex numbers, ``error`` the answer minus the truth; ``turn`` is the answer's heading error [rad],
    ``back`` the rotation that takes it back, ``beside`` the answer's point so rotated minus the true one; all NaN where
    there is no answer. ``path_m`` and ``clock_ns``: true path and time since the first instant. ``joined`` (n - 1,):
    whether an instant and the next one belong to one run.
    """

    true: Points
    error: Points
    said: Points
    turn: Floats
    back: Points
    beside: Points
    path_m: Floats
    clock_ns: Whole
    joined: Flags

    @classmethod
    def of(cls, measured: Errors) -> Poses:
        """Those of all instants."""
        true, error = measured.x + 1j * measured.y, measured.dx + 1j * measured.dy
        said = true + error
        back = np.cos(measured.turn) - 1j * np.sin(measured.turn)
        joined = measured.run[1:] == measured.run[:-1]
        path_m, clock_ns = np.zeros(len(true)), np.zeros_like(measured.time_ns)
        np.cumsum(np.where(joined, np.abs(true[1:] - true[:-1]), APART), out=path_m[1:])
        np.cumsum(np.where(joined, measured.time_ns[1:] - measured.time_ns[:-1], nanoseconds(APART)), out=clock_ns[1:])
        return cls(true, error, said, measured.turn, back, said * back - true, path_m, clock_ns, joined)

    @property
    def period_ns(self) -> int:
        """From each instant to the next; 0 where they are not even."""
        steps = self.clock_ns[1:] - self.clock_ns[:-1]
        return int(steps[0]) if len(steps) and steps.min() == steps.max() else 0


def relative_errors(poses: Poses, start: slice | Whole, end: slice | Whole) -> Floats:
    """Size of translation [m] and rotation [rad] of E = (T_i⁻¹ T_j)⁻¹ (T̂_i⁻¹ T̂_j) in SE(2) for k pairs (i, j), (2, k);
    NaN where an end has no answer, or one without a heading.

    Turning E by the true heading at i leaves its size: what remains is the answer's step, turned back by the heading
    error at i, minus the true step.
    """
    moved = poses.said[end] * poses.back[start]
    moved -= poses.true[end]
    moved -= poses.beside[start]
    turned = np.abs(poses.turn[end] - poses.turn[start])
    return np.array([np.abs(moved), np.minimum(turned, 2.0 * np.pi - turned)])


def velocity_metrics(poses: Poses) -> dict[str, float]:
    """Size of the difference between the mean velocities over 1 s of answers and truth [m/s]: mean and p95."""
    start, end = later(poses.clock_ns, nanoseconds(SPEED_WINDOW_S), poses.period_ns)
    gained = np.abs(poses.error[end] - poses.error[start])
    speed = gained / ((poses.clock_ns[end] - poses.clock_ns[start]) / NANOSECONDS)
    known = speed[~np.isnan(speed)]
    return {"vel_err": mean(known), "vel_err_p95": quantile(known, 0.95)}


def step_metrics(poses: Poses, age_s: Floats, top_speed_m_s: float = TOP_SPEED_M_S) -> dict[str, float]:
    """From one answered instant to the next: jumps per minute, and the answers' path over the true one.

    A jump is a step longer than ``top_speed_m_s`` allows in the time between the stamps of both answers, which are
    ``age_s`` (n,) old, plus 0.10 m.
    """
    moved = poses.true[1:] - poses.true[:-1]
    step = np.abs(moved + (poses.error[1:] - poses.error[:-1]))
    seconds = (poses.clock_ns[1:] - poses.clock_ns[:-1]) / NANOSECONDS
    known_s = np.where(np.isfinite(age_s), age_s, 0.0)
    stamped = seconds - (known_s[1:] - known_s[:-1])
    both = np.isfinite(step) & poses.joined
    jumps = step[both] > top_speed_m_s * stamped[both] + JUMP_M
    minutes, length = float(seconds[both].sum()) / 60.0, float(np.abs(moved)[both].sum())
    return {
        "jump_rate": float(np.count_nonzero(jumps)) / minutes if minutes else math.nan,
        "path_ratio": float(step[both].sum()) / length if length else math.nan,
    }
