"""The start of a run and the prior there: one rule for import, inspection, calibration, benchmarks and review.

A run starts at the first time that any of its measurements covers (`begin_ns`). Its prior, in this order: the one that
the log brings; else the true pose at the start (the last one up to it, or the first one of all where truth begins
later), its heading unknown where the truth has none; else, without truth, nothing: position and heading unknown, the
moments of a uniform distribution over the floor. An import takes the same true pose, and may find its heading from
motion; the log keeps that prior.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from fusion import Bounds, Covariance, Increment, Measurement, Odometry, OdometryNoise, Pose, Prior, Truth
from fusion.belief import UNKNOWN_HEADING_STD
from fusion.timeline import order
from fusion.values import NANOSECONDS
from logs.run import Run
from logs.truth import TruthTrack

POSITION_STD_M = 0.05
"""Standard deviation of each coordinate of a start that is taken from the truth: set by hand, not to the millimetre."""
HEADING_STD_RAD = 0.05
"""Standard deviation of its heading, where the truth has one; likewise."""


def begin_ns(measurements: Iterable[Measurement]) -> int:
    """The first time that any measurement covers, 0 of none. An increment begins before its own stamp, and must not
    count twice.
    """
    return min((m.from_ns if isinstance(m, Odometry) else m.time_ns for m in measurements), default=0)


def starting_prior(run: Run) -> Prior:
    """The prior every estimator of ``run`` starts from, by the order above."""
    if run.prior is not None:
        return run.prior
    start_ns = begin_ns(run.measurements)
    truth = None if run.truth is None else true_start(run.truth, start_ns)
    if truth is None:
        return _unknown(run.world.bounds, start_ns)
    return _known(truth, truth.known_heading, HEADING_STD_RAD)


def true_start(truth: TruthTrack, start_ns: int) -> Truth | None:
    """The last true pose with a position up to ``start_ns``, or the first of all where truth begins later."""
    placed = np.flatnonzero(np.isfinite(truth.x) & np.isfinite(truth.y))
    if len(placed) == 0:
        return None
    up_to_start = placed[truth.time_ns[placed] <= start_ns]
    row = int(up_to_start[-1] if len(up_to_start) else placed[0])
    heading = float(truth.heading[row])
    known = heading if math.isfinite(heading) else None
    return Truth(int(truth.time_ns[row]), float(truth.x[row]), float(truth.y[row]), known)


def prior_from_truth(
    measurements: Sequence[Measurement], truths: Sequence[Truth], *, path_m: float = 1.0, heading_std: float = 0.2
) -> tuple[Prior | None, str]:
    """A prior for an import at the true pose where the measurements start, and a sentence that states how it was made.

    Where the truth has no heading there, it is found from the first ``path_m`` of odometry, with ``heading_std`` [rad],
    or unknown.
    """
    track = TruthTrack.from_truths(truths)
    first = true_start(track, begin_ns(measurements))
    if first is None:
        return None, "no truth: start unknown"
    if first.known_heading is not None:
        how = f"true pose at the start, {POSITION_STD_M:g} m, {HEADING_STD_RAD:g} rad"
        return _known(first, first.known_heading, HEADING_STD_RAD), how
    odometry = sorted((m for m in measurements if isinstance(m, Odometry) and m.time_ns > first.time_ns), key=order)
    heading = heading_from_motion(odometry, track, first, path_m)
    if heading is None:
        return _known(first, None, heading_std), "true position at the start, heading unknown"
    how = f"true position at the start, heading from the first {path_m:g} m of motion against the truth"
    return _known(first, heading, heading_std), how


def heading_from_motion(odometry: Sequence[Odometry], truth: TruthTrack, first: Truth, path_m: float) -> float | None:
    """The heading [rad] at ``first`` with which the first ``path_m`` of odometry follow the truth, or None without
    motion.

    Closed form: the rotation about the start that minimises the squared distances (2-D Procrustes; Arun et al. 1987).
    """
    sine = cosine = 0.0
    motion, noise = Increment(), OdometryNoise()
    newest = np.searchsorted(truth.time_ns, [step.time_ns for step in odometry], side="right") - 1
    for step, row in zip(odometry, newest.tolist(), strict=True):
        motion = motion.extend(step, noise)
        if step.time_ns - int(truth.time_ns[row]) > NANOSECONDS:
            continue
        dx, dy = float(truth.x[row]) - first.x, float(truth.y[row]) - first.y
        cosine += motion.x * dx + motion.y * dy
        sine += motion.x * dy - motion.y * dx
        if motion.path_m >= path_m:
            break
    return math.atan2(sine, cosine) if math.hypot(sine, cosine) > 1e-6 else None


def _known(truth: Truth, heading: float | None, heading_std: float) -> Prior:
    """The prior at a true position with that heading; None: unknown, whatever ``heading_std``."""
    spread = UNKNOWN_HEADING_STD if heading is None else heading_std
    covariance = Covariance.from_std(POSITION_STD_M, POSITION_STD_M, spread)
    return Prior(truth.time_ns, Pose(truth.x, truth.y, heading or 0.0), covariance, heading_known=heading is not None)


def _unknown(floor: Bounds, start_ns: int) -> Prior:
    width_m, depth_m = floor.x_max - floor.x_min, floor.y_max - floor.y_min
    return Prior(
        start_ns,
        Pose(floor.x_min + 0.5 * width_m, floor.y_min + 0.5 * depth_m, 0.0),
        Covariance.from_std(width_m / math.sqrt(12.0), depth_m / math.sqrt(12.0), UNKNOWN_HEADING_STD),
        position_known=False,
        heading_known=False,
    )
