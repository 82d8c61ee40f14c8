"""An estimator: a random walk that every radio reading corrects, a Kalman filter of position alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Increment,
    Pose,
    Prior,
    Ranges,
    Reason,
    Tag,
    WifiScan,
    World,
    radio_readings,
)
from fusion.arrays import Floats


class State(NamedTuple):
    """A position (2,) [m] and its covariance (2, 2) [m²]."""

    position: Floats
    covariance: Floats
    valid: bool


class RandomWalk:
    """Radio alone: between readings the robot may be anywhere nearby."""

    summary = "a random walk that radio corrects"
    tags = frozenset({Tag.NO_HEADING, Tag.NOT_ROBUST})

    def __init__(self, world: World, *, std_per_sqrt_s: float = 0.5) -> None:
        self.world, self.std_per_sqrt_s = world, std_per_sqrt_s
        self.antenna_m = (0.0, 0.0, world.robot.antenna_m[2])  # without a heading its arm cannot be taken off

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - it draws nothing
        """The prior, without its heading."""
        return State(np.array(prior.pose[:2]), np.array(prior.covariance.matrix)[:2, :2], prior.position_known)

    def walked(self, state: State, motion: Increment) -> State:
        """The state after ``motion``, of which only the time counts."""
        return state._replace(covariance=state.covariance + self.std_per_sqrt_s**2 * motion.duration_s * np.eye(2))

    def step(self, state: State, motion: Increment, scan: WifiScan | Ranges | None) -> tuple[State, tuple[Fate, ...]]:
        """Kalman's equations, linear about the position before the scan."""
        state = self.walked(state, motion)
        if scan is None:
            return state, ()
        seen = radio_readings(self.world, scan)
        x, y = state.position.tolist()
        expected = [one.expect(x, y, 0.0, self.antenna_m) for one in seen]
        innovation = np.array([one.value - other.value for one, other in zip(seen, expected, strict=True)])
        H, P = np.array([(one.by_x, one.by_y) for one in expected]), state.covariance
        S = H @ P @ H.T + np.diag([one.variance + one.model.bias_std**2 for one in seen])
        K = P @ H.T @ np.linalg.inv(S)
        corrected = State(state.position + K @ innovation, P - K @ S @ K.T, state.valid)
        source = (scan.time_ns, scan.sensor, scan.seq)
        fates = tuple(
            Fate(*source, one.anchor.id, Decision.USED, Reason.OK, 1.0, error, variance, error**2 / variance)
            for one, error, variance in zip(seen, innovation.tolist(), S.diagonal().tolist(), strict=True)
        )
        return corrected, fates

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The position after ``motion``; of the heading nothing is known."""
        position, P, valid = self.walked(state, motion)
        (xx, xy), (_, yy) = P.tolist()
        x, y = position.tolist()
        return Estimate(time_ns, Pose(x, y, 0.0), Covariance(xx, xy, 0.0, yy, 0.0, 3.3), valid, heading_known=False)
