"""filterpy as a careful user drives it: the loops that our estimators are compared with.

Both take numbers instead of messages, with the noise of every step worked out beforehand: order, screening, gates and
Fates, which our side has, are left out, so the comparison leans to filterpy. Its extended Kalman filter gets analytic
Jacobians in arrays that are written in place, and all ranges of a scan in one update. It has no particle filter, only
resampling: the loop around it is numpy over arrays of particles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.performance.drive import RANGE_STD_M, Drive, step_variances
from benchmarks.performance.implementation import Belief, Implementation
from fusion import Covariance, Pose, wrap_angle
from fusion.arrays import Floats
from fusion.weighted_points import moments

Step = tuple[float, float, float, float, float]
"""Distance [m] and turn [rad] of one step, and the variances of its noise: forward, sideways, turn."""
Scan = tuple[Floats, Sequence[tuple[float, float]]]
"""Ranges (m,) and the places of their anchors [m]."""


def missing_filterpy() -> str | None:
    """A sentence where filterpy is not installed, None where it is."""
    if find_spec("filterpy") is not None:
        return None
    return "filterpy is not installed, so nothing is compared with it; pip install 'fusion-localization[filterpy]'"


def as_numbers(driven: Drive) -> list[tuple[list[Step], Scan]]:
    """The blocks of a drive without its messages."""
    noise = driven.world.robot.noise
    places = {anchor.id: (anchor.x, anchor.y) for anchor in driven.world.anchors}
    return [
        (
            [(step.distance_m, step.turn_rad, *step_variances(noise, step)) for step in steps],
            (np.array([one.range_m for one in scan.readings]), [places[one.anchor] for one in scan.readings]),
        )
        for steps, scan in driven.blocks
    ]


def ekf_loop() -> Implementation:
    """The extended Kalman filter of filterpy over (x, y, heading). Needs filterpy."""
    return Implementation("filterpy's EKF", EkfLoop, as_numbers)


def particle_loop() -> Implementation:
    """A particle filter of 1000 poses in numpy, with the resampling of filterpy. Needs filterpy."""
    return Implementation("particle loop", ParticleLoop, as_numbers)


class EkfLoop:
    """`filterpy.kalman.ExtendedKalmanFilter` along a drive."""

    def __init__(self, driven: Drive) -> None:
        from filterpy.kalman import ExtendedKalmanFilter

        class PoseFilter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy is not typed
            """Motion by the caller: filterpy's own way to leave out x <- F x + B u."""

            def predict_x(self, u: object = 0) -> None:
                pass

        self._filter = PoseFilter(dim_x=3, dim_z=3)
        self._filter.x, self._filter.P = np.array(driven.prior.pose), np.array(driven.prior.covariance.matrix)
        self._filter.F, self._filter.Q = np.eye(3), np.zeros((3, 3))
        self._heading = driven.prior.pose.heading
        self._noise: dict[int, Floats] = {}

    def move(self, steps: Sequence[Step]) -> None:
        """One prediction a step, by the mid-point rule."""
        belief = self._filter
        x, f, q = belief.x, belief.F, belief.Q
        for distance, turn, forward, side, turned in steps:
            middle = self._heading + 0.5 * turn
            c, s = math.cos(middle), math.sin(middle)
            dx, dy = distance * c, distance * s
            self._heading += turn
            x += (dx, dy, turn)
            f[0, 2], f[1, 2] = -dy, dx
            gx, gy = -0.5 * dy, 0.5 * dx
            xy, xh, yh = c * s * (forward - side) + gx * gy * turned, gx * turned, gy * turned
            q[:] = (
                (c * c * forward + s * s * side + gx * xh, xy, xh),
                (xy, s * s * forward + c * c * side + gy * yh, yh),
                (xh, yh, turned),
            )
            belief.predict()

    def update(self, scan: Scan) -> None:
        """One update by all ranges."""
        ranges, places = scan
        x, y, _ = self._filter.x.tolist()
        expected, rows = [], []
        for ax, ay in places:
            dx, dy = x - ax, y - ay
            distance = math.hypot(dx, dy)
            expected.append(distance)
            rows.append((dx / distance, dy / distance, 0.0))
        jacobian, values = np.array(rows), np.array(expected)
        noise = self._noise.get(len(rows))
        if noise is None:
            noise = self._noise[len(rows)] = RANGE_STD_M**2 * np.eye(len(rows))
        self._filter.update(ranges, lambda _: jacobian, lambda _: values, R=noise)
        self._heading = float(self._filter.x[2])

    def belief(self) -> Belief:
        """Its x and P."""
        x, y, heading = self._filter.x.tolist()
        return Belief(Pose(x, y, wrap_angle(heading)), Covariance.from_matrix(self._filter.P.tolist()))


class ParticleLoop:
    """A thousand poses along a drive, resampled by `filterpy.monte_carlo.systematic_resample`."""

    count = 1000

    def __init__(self, driven: Drive) -> None:
        from filterpy.monte_carlo import systematic_resample

        self._resample: Any = systematic_resample
        self._random = np.random.default_rng(0)
        spread = np.sqrt(np.diag(driven.prior.covariance.matrix))
        drawn = self._random.standard_normal((3, self.count))
        self._x, self._y, self._heading = np.array(driven.prior.pose)[:, None] + spread[:, None] * drawn
        self._weights = np.full(self.count, 1.0 / self.count)

    def move(self, steps: Sequence[Step]) -> None:
        """Every particle moves at every step, with noise of its own."""
        for distance, turn, forward, side, turned in steps:
            along, across, more = self._random.standard_normal((3, self.count))
            along = distance + math.sqrt(forward) * along
            across *= math.sqrt(side)
            more = turn + math.sqrt(turned) * more
            middle = self._heading + 0.5 * more
            c, s = np.cos(middle), np.sin(middle)
            self._x += along * c - across * s
            self._y += along * s + across * c
            self._heading += more

    def update(self, scan: Scan) -> None:
        """Weigh by the ranges; resample when fewer than half the particles count."""
        log_weights = np.log(self._weights)
        for value, (ax, ay) in zip(scan[0].tolist(), scan[1], strict=True):
            log_weights -= 0.5 / RANGE_STD_M**2 * np.square(value - np.hypot(self._x - ax, self._y - ay))
        weights = np.exp(log_weights - log_weights.max()) + 1e-300
        self._weights = weights / weights.sum()
        if 1.0 / (self._weights @ self._weights) < 0.5 * self.count:
            chosen = self._resample(self._weights)
            self._x, self._y, self._heading = self._x[chosen], self._y[chosen], self._heading[chosen]
            self._weights = np.full(self.count, 1.0 / self.count)

    def belief(self) -> Belief:
        """Mean and covariance of the particles."""
        return Belief(*moments(self._weights, self._x, self._y, self._heading))
