"""Agreement of answers and truth from one time to a later one: relative pose errors, speed, jumps, length."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows
from fusion.arrays import Floats, Points, Whole, points
from fusion.quantiles import known, mean, quantile, root_mean_square
from fusion.values import NANOSECONDS
from logs.truth import DISTANCES_M, DURATIONS_S, Instants

TOP_SPEED_M_S = 2.0
"""Speed that no indoor robot exceeds, where none is declared."""
JUMP_M = 0.10
REACHES = (*(f"d_{reach}m" for reach in DISTANCES_M), *(f"t_{reach}s" for reach in DURATIONS_S))
METRICS = (
    *rows(
        " ".join(f"rpe_{reach}_{what}" for reach in REACHES for what in ("rmse", "median")),
        "m",
        Better.LESS,
        "relative pose error in SE(2), translation, after so much true path, or time",
    ),
    *rows(
        " ".join(f"rpe_{reach}_rot_{what}" for reach in REACHES for what in ("rmse", "median")),
        "rad",
        Better.LESS,
        "its rotation",
        "true heading",
    ),
    *rows(" ".join(f"rpe_{reach}_n" for reach in REACHES), "count", Better.MORE, "pairs of poses behind it"),
    *rows("vel_err vel_err_p95", "m/s", Better.LESS, "error of the velocity over 1 s, mean and 95 % quantile"),
    *rows("jump_rate", "1/min", Better.LESS, "jumps that no robot makes, 2 m/s and 10 cm"),
    *rows("path_ratio", "1", Better.NEITHER, "path of the estimates over the true one"),
)
"""Of the functions below."""


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
    whole = not np.isnan(poses.turn).any()
    scores: dict[str, float] = {}
    for reach, (start, end) in poses.instants.pairs.items():
        moved, turned = relative_errors(poses, start, end)
        if not whole:
            both = ~(np.isnan(moved) | np.isnan(turned))
            moved, turned = moved[both], turned[both]
        scores[f"rpe_{reach}_n"] = float(len(moved))
        for what, sizes in ((reach, moved), (f"{reach}_rot", turned)):
            scores[f"rpe_{what}_rmse"], scores[f"rpe_{what}_median"] = root_mean_square(sizes), quantile(sizes, 0.5)
    return scores


class Poses(NamedTuple):
    """Columns that every metric of this module is computed from, (n,).

    Points [m] are complex numbers, ``error`` the answer minus the truth; ``turn`` is the answer's heading error [rad],
    ``back`` the rotation that takes it back, ``beside`` the answer's point so rotated minus the true one; all NaN where
    there is no answer.
    """

    instants: Instants
    error: Points
    estimated: Points
    turn: Floats
    back: Points
    beside: Points

    @classmethod
    def of(cls, measured: Errors) -> Poses:
        """Those of all instants."""
        true, error = measured.instants.points, points(measured.dx, measured.dy)
        estimated, back = true + error, _turned_by(-measured.turn)
        return cls(measured.instants, error, estimated, measured.turn, back, estimated * back - true)


def _turned_by(angle: Floats) -> Points:
    """exp(i angle), by the tangent of half the angle: that costs half of a cosine and a sine."""
    tangent = np.tan(0.5 * angle)
    share = 2.0 / (1.0 + tangent * tangent)
    return points(share - 1.0, tangent * share)


def relative_errors(poses: Poses, start: slice | Whole, end: slice | Whole) -> tuple[Floats, Floats]:
    """Size of translation [m] and of rotation [rad] of E = (T_i⁻¹ T_j)⁻¹ (T̂_i⁻¹ T̂_j) in SE(2) for k pairs (i, j), both
    (k,); NaN where an end has no answer, or one without a heading.

    Turning E by the true heading at i leaves its size: what remains is the answer's step, turned back by the heading
    error at i, minus the true step.
    """
    moved = poses.estimated[end] * poses.back[start]
    moved -= poses.instants.points[end]
    moved -= poses.beside[start]
    turned = np.abs(poses.turn[end] - poses.turn[start])
    return np.abs(moved), np.minimum(turned, 2.0 * np.pi - turned)


def velocity_metrics(poses: Poses) -> dict[str, float]:
    """Size of the difference between the mean velocities over 1 s of answers and truth [m/s]: mean and p95."""
    time_ns, (start, end) = poses.instants.time_ns, poses.instants.pairs["t_1s"]
    gained = np.abs(poses.error[end] - poses.error[start])
    speed = gained / ((time_ns[end] - time_ns[start]) / NANOSECONDS)
    speed = known(speed)
    return {"vel_err": mean(speed), "vel_err_p95": quantile(speed, 0.95)}


def step_metrics(poses: Poses, age_s: Floats, top_speed_m_s: float = TOP_SPEED_M_S) -> dict[str, float]:
    """From one answered instant to the next: jumps per minute, and the answers' path over the true one.

    A jump is a step longer than ``top_speed_m_s`` allows in the time between the stamps of both answers, which are
    ``age_s`` (n,) old, plus 0.10 m.
    """
    true, time_ns = poses.instants.points, poses.instants.time_ns
    step = np.abs(true[1:] - true[:-1] + (poses.error[1:] - poses.error[:-1]))
    seconds = (time_ns[1:] - time_ns[:-1]) / NANOSECONDS
    known_s = np.where(np.isfinite(age_s), age_s, 0.0)
    both = np.isfinite(step)
    jumps = both & (step > top_speed_m_s * (seconds - (known_s[1:] - known_s[:-1])) + JUMP_M)
    columns = (seconds / 60.0, step, poses.instants.step_m)
    minutes, path_m, true_m = (float(np.add.reduce(column, where=both)) for column in columns)
    return {
        "jump_rate": float(np.count_nonzero(jumps)) / minutes if minutes else math.nan,
        "path_ratio": path_m / true_m if true_m else math.nan,
    }
