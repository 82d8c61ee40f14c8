"""The start of a run and the prior there: one rule for import, inspection and benchmarks.

In this order: the prior that the log brings; else the true pose where the measurements begin (the last one before that,
or the first one of all where truth begins later), its heading unknown where the truth has none; else, without truth,
nothing: position and heading unknown, the pose at the middle of the floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from fusion import Bounds, Covariance, Increment, Measurement, Odometry, OdometryNoise, Pose, Prior, Truth
from fusion.belief import UNKNOWN_HEADING_STD
from fusion.values import NANOSECONDS
from logs.importers.foreign_recording import _prior
from logs.run import Run


def heading_from_motion(odometry: Sequence[Odometry], truths: Sequence[Truth], path_m: float) -> float | None:
    """The start heading [rad] with which the first ``path_m`` of odometry follow the truth, or None without motion.

    Closed form: the rotation about the start that minimises the squared distances (2-D Procrustes; Arun et al. 1987).
    """
    sine = cosine = 0.0
    motion, noise, place = Increment(), OdometryNoise(), 0
    first = truths[0]
    for step in odometry:
        motion = motion.extend(step, noise)
        while place + 1 < len(truths) and truths[place + 1].time_ns <= step.time_ns:
            place += 1
        ahead = truths[place]
        if ahead.time_ns != step.time_ns and step.time_ns - ahead.time_ns > NANOSECONDS:
            continue
        dx, dy = ahead.x - first.x, ahead.y - first.y
        cosine += motion.x * dx + motion.y * dy
        sine += motion.x * dy - motion.y * dx
        if motion.path_m >= path_m:
            break
    return math.atan2(sine, cosine) if math.hypot(sine, cosine) > 1e-6 else None


def prior_from_truth(
    odometry: Sequence[Odometry], truths: Sequence[Truth], *, path_m: float = 1.0, heading_std: float = 0.2
) -> tuple[Prior | None, str]:
    """A starting prior at the first true pose with a position, and a sentence that states how it was made.

    Without a heading there, it is found from the first ``path_m`` of motion, with ``heading_std`` [rad], or unknown.
    """
    placed = [truth for truth in truths if truth.position_known]
    if not placed:
        return None, "no truth: start unknown"
    first, heading = placed[0], placed[0].known_heading
    if heading is not None:
        return _prior(first, heading, HEADING_STD_RAD), "first true pose, 0.05 m, 0.05 rad"
    after = [step for step in odometry if step.time_ns > first.time_ns]
    heading = heading_from_motion(after, placed, path_m)
    if heading is None:
        return _prior(first, None, UNKNOWN_HEADING_STD), "first true position, heading unknown"
    how = f"first true position, heading from the first {path_m:g} m of motion against the truth"
    return _prior(first, heading, heading_std), how


def _start(run: Run) -> Prior:
    """The log's prior, else the first true pose, else nothing known; not later than the first measurement."""
    if run.prior is not None:
        return run.prior
    begin_ns = min((m.from_ns if isinstance(m, Odometry) else m.time_ns for m in run.measurements), default=0)
    if run.truth is not None:
        x, y, heading = (float(column[0]) for column in (run.truth.x, run.truth.y, run.truth.heading))
        known = None if math.isnan(heading) else heading
        prior, _ = prior_from_truth([], [Truth(begin_ns, x, y, known)] if math.isfinite(x + y) else [])
        if prior is not None:
            return prior
    floor = run.world.bounds
    middle = Pose(0.5 * (floor.x_min + floor.x_max), 0.5 * (floor.y_min + floor.y_max), 0.0)
    wide = Covariance.from_std(floor.x_max - floor.x_min, floor.y_max - floor.y_min, math.pi)
    return Prior(begin_ns, middle, wide, position_known=False, heading_known=False)


POSITION_STD_M = 0.1
"""How well a pose taken from the truth is said to be known: set down by hand, not to the millimetre."""
HEADING_STD_RAD = 0.05


def starting_prior(run: Run) -> Prior:
    """The prior every estimator of ``run`` starts from, by the order above."""
    if run.prior is not None:
        return run.prior
    start_ns = begin_ns(run.measurements)
    return _from_truth(run, start_ns) or _unknown(run.world.bounds, start_ns)


def begin_ns(measurements: Iterable[Measurement]) -> int:
    """The first time any measurement tells of: an increment begins before its own stamp, and must not count twice."""
    return min((m.from_ns if isinstance(m, Odometry) else m.time_ns for m in measurements), default=0)


def _from_truth(run: Run, start_ns: int) -> Prior | None:
    if run.truth is None:
        return None
    known = np.flatnonzero(np.isfinite(run.truth.x) & np.isfinite(run.truth.y))
    if len(known) == 0:
        return None
    before = known[run.truth.time_ns[known] <= start_ns]
    first = int(before[-1] if len(before) else known[0])
    heading = float(run.truth.heading[first])
    is_known = math.isfinite(heading)
    heading_std = HEADING_STD_RAD if is_known else UNKNOWN_HEADING_STD
    return Prior(
        int(run.truth.time_ns[first]),
        Pose(float(run.truth.x[first]), float(run.truth.y[first]), heading if is_known else 0.0),
        Covariance.from_std(POSITION_STD_M, POSITION_STD_M, heading_std),
        heading_known=is_known,
    )


def _unknown(floor: Bounds, start_ns: int) -> Prior:
    width_m, depth_m = floor.x_max - floor.x_min, floor.y_max - floor.y_min
    return Prior(
        start_ns,
        Pose(floor.x_min + 0.5 * width_m, floor.y_min + 0.5 * depth_m, 0.0),
        Covariance.from_std(width_m / math.sqrt(12.0), depth_m / math.sqrt(12.0), UNKNOWN_HEADING_STD),
        position_known=False,
        heading_known=False,
    )
