"""Where an estimator may start: the same for all of them, decided before any of them runs.

In this order: the prior the log brings; else the true pose where the measurements begin (the last one before that, or
the first one of all where truth begins later), its heading unknown where the truth has none; else, without truth,
nothing: position and heading unknown, the pose at the middle of the floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from fusion import Bounds, Covariance, Measurement, Odometry, Pose, Prior
from fusion.belief import UNKNOWN_HEADING_STD
from logs.run import Run

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
