"""Promises of time and order: late measurements, the rate of odometry, stretches closed early, looking ahead."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from fusion.conformance.folds import NEAR_RAD, NOISY, distance, require_same, states_of, updates_of
from fusion.conformance.promise import Promise, promise, require
from fusion.epochs import LONGEST, Longest
from fusion.estimator import Tag
from fusion.tracker import final
from fusion.values import NANOSECONDS, Odometry, nanoseconds, seconds

PROMISES: list[Promise] = []
NEAR_CLOSED = 0.01
"""Largest move of a pose [m, rad] where stretches of motion are closed early: what first order leaves out."""
SHORT = Longest(duration_s=0.25)
"""Several stretches to a scan."""


@promise(PROMISES, "later-not-surer", "A later estimate is never more certain.", unless=[Tag.NO_COVARIANCE])
def _later_not_surer(made: type[Any]) -> None:
    noise = NOISY.world().robot.noise
    for estimator, state, epoch in states_of(made, NOISY):
        later_ns = epoch.time_ns + 5 * NANOSECONDS
        blind = Odometry(later_ns, "", 0, epoch.time_ns, 0.0, 0.0, measured=False)
        now = estimator.estimate(state, epoch.motion, epoch.time_ns)
        later = estimator.estimate(state, epoch.motion.extend(blind, noise), later_ns)
        if now.covariance is None or later.covariance is None or not later.valid:
            continue
        for name, before, after in zip(now.covariance._fields, now.covariance, later.covariance, strict=True):
            require(
                name not in ("xx", "yy", "hh") or after >= before * (1.0 - 1e-9),
                f"variance {name} falls from {before:.6g} to {after:.6g} by looking 5 s ahead "
                f"from {seconds(epoch.time_ns)} s",
            )


@promise(PROMISES, "order-of-arrival", "Late inside the horizon equals in order.")
def _order_of_arrival(made: type[Any]) -> None:
    measurements = NOISY.measurements()
    delays_s = np.random.Generator(np.random.PCG64(3)).uniform(0.0, 1.0, len(measurements))
    arrival = [one.time_ns + nanoseconds(float(wait)) for one, wait in zip(measurements, delays_s, strict=True)]
    shuffled = [measurements[i] for i in np.argsort(arrival, kind="stable")]
    late = final(updates_of(made, NOISY, shuffled))
    require_same(final(updates_of(made, NOISY, measurements)), late, "measurements that arrive late change the answer")


@promise(PROMISES, "rate-means-nothing", "One motion measured at 10 or 50 Hz gives one answer.")
def _rate_means_nothing(made: type[Any]) -> None:
    slow, fast = (updates_of(made, replace(NOISY, odometry_hz=rate))[-1].estimate for rate in (10, 50))
    off = distance(slow.pose, fast.pose)
    require(off < 0.01, f"odometry at 50 Hz instead of 10 moves the pose by {off:.3g}")
    # The variance of n samples strays by sqrt(2 / n) of itself, so chance is given more room.
    tolerance = 0.25 if Tag.STOCHASTIC in made.tags else 0.05
    if slow.covariance is not None and fast.covariance is not None:
        for name in ("xx", "yy", "hh"):
            one, other = getattr(slow.covariance, name), getattr(fast.covariance, name)
            require(
                math.isclose(one, other, rel_tol=tolerance),
                f"variance {name} is {one:.6g} with odometry at 10 Hz, {other:.6g} at 50 Hz",
            )


@promise(PROMISES, "closing-changes-little", "A stretch of motion may be closed early: what follows is the same.")
def _closing_changes_little(made: type[Any]) -> None:
    ends = []
    for longest in (LONGEST, SHORT):
        for estimator, state, epoch in states_of(made, NOISY, longest):
            if epoch.scan is None:
                _, fates = estimator.step(state, epoch.motion, None)
                require(not fates, f"a stretch without radio was closed, and its step reports {len(fates)} fates")
        ends.append(estimator.estimate(state, epoch.motion, epoch.time_ns))
    off = distance(ends[0].pose, ends[1].pose)
    chance = Tag.STOCHASTIC in made.tags
    require(off < (NEAR_RAD if chance else NEAR_CLOSED), f"stretches closed early move the pose by {off:.3g}")
    for name in ("xx", "yy", "hh"):
        one, other = (getattr(end.covariance, name, 1.0) for end in ends)
        require(
            math.isclose(one, other, rel_tol=0.25 if chance else 0.05),
            f"variance {name} is {one:.6g}, and {other:.6g} where stretches are closed early",
        )
