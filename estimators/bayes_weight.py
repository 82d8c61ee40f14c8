"""The weighted average of Moro & Mehrpouyan 2019 (Algorithm 1) with weights by Bayes' rule: the paper's future work.

Each radio fix is either good, with the covariance of its trilateration, or an outlier anywhere on the floor. The
weight of the fix is the Kalman gain of a good one times the posterior probability that it is good: the probabilistic
data association filter with one measurement (Bar-Shalom, Li & Kirubarajan 2001, section 6.4; Bar-Shalom & Tse 1975).
The posterior of the two cases is moment-matched, so the covariance grows when they disagree.

Successive fixes count as independent. Errors that stay, anchor biases and odometry calibration, are not in its state:
where they are large it is more certain than it should be.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Increment,
    ParameterError,
    Pose,
    Prior,
    Radio,
    Reason,
    Tag,
    World,
    compose,
    radio_readings,
    unusable,
    wrap_angle,
)
from fusion.arrays import Floats
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.fates import fix_fates
from fusion.position_fix import Recent, fix_from, fix_innovation, remember
from fusion.trilateration import Fix
from fusion.values import nanoseconds

USED_FROM = 0.5
"""A fix more likely good than not counts as used."""
LARGEST_EXPONENT = 600.0
"""exp of more is near the end of what a float holds; an outlier is certain long before."""


class State(NamedTuple):
    """Pose and covariance at the last epoch, and readings waiting for a fix."""

    pose: Pose
    covariance: Covariance
    recent: Recent
    position_known: bool


class BayesWeight:
    """Weighted average with Bayesian weights.

    Parameters
    ----------
    outlier_probability
        Prior probability that a fix is an outlier; 0 makes this a Kalman filter on fixes.
    window_s
        How long readings wait for those of other anchors to make a fix [s]; each reading is used once.
    """

    summary: ClassVar[str] = "weighted average of odometry and fix, weights by Bayes' rule"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.GLOBAL_START})

    def __init__(self, world: World, *, outlier_probability: float = 0.2, window_s: float = 2.5) -> None:
        if not 0.0 <= outlier_probability < 1.0 or window_s < 0.0:
            raise ParameterError(
                "bayes_weight: outlier_probability must be in [0, 1) and window_s not negative; "
                f"got {outlier_probability}, {window_s}"
            )
        self._world = world
        self._outlier_probability = outlier_probability
        self._window_ns = nanoseconds(window_s)
        bounds = world.bounds
        self._outlier_density = 1.0 / ((bounds.x_max - bounds.x_min) * (bounds.y_max - bounds.y_min))

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior, no motion yet."""
        return State(*starting_belief(self._world, prior), (), prior.position_known)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Move; weigh a fix in when there is one."""
        pose, covariance = compose(state.pose, state.covariance, motion)
        if scan is None:
            return state._replace(pose=pose, covariance=covariance), ()
        seen = radio_readings(self._world, scan)
        recent = remember(state.recent, scan.time_ns, seen, self._window_ns)
        fix = fix_from(recent, self._world.robot)
        if isinstance(fix, Reason):
            return state._replace(pose=pose, covariance=covariance, recent=recent), unusable(scan, fix)
        moved, moved_covariance, good = self.weigh(pose, covariance, fix, position_known=state.position_known)
        verdict = (Decision.USED, Reason.OK) if good >= USED_FROM else (Decision.DOWNWEIGHTED, Reason.OUTLIER)
        fates = fix_fates(scan, seen, self._world.robot, (pose, covariance), verdict, good)
        return State(moved, moved_covariance, (), position_known=True), fates

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The pose after the motion since; not valid from an unknown position before the first fix."""
        pose, covariance = compose(state.pose, state.covariance, motion)
        known = covariance.hh < HEADING_KNOWN_STD**2
        return Estimate(time_ns, pose, covariance, valid=state.position_known, heading_known=known)

    def weigh(
        self, pose: Pose, covariance: Covariance, fix: Fix, *, position_known: bool = True
    ) -> tuple[Pose, Covariance, float]:
        """Pose, covariance, and the posterior probability that ``fix`` is good.

        A position that may be anywhere on the floor expects a good fix no less than an outlier there, so that
        probability is then the prior one.
        """
        p, r = np.array(covariance.matrix), np.array(fix.matrix)
        innovation, h = fix_innovation(pose, fix, self._world.robot)
        s = h @ p @ h.T + r
        good = self._probability_good(innovation, s) if position_known else 1.0 - self._outlier_probability
        gain = p @ h.T @ np.linalg.inv(s)
        # Moment matching: P - beta K S Kᵀ + beta (1 - beta) (K nu)(K nu)ᵀ, and the mean moves by beta K nu.
        jump = gain @ innovation
        p = p - good * gain @ s @ gain.T + good * (1.0 - good) * np.outer(jump, jump)
        x, y, heading = (np.array(pose) + good * jump).tolist()
        spread = Covariance.from_matrix((0.5 * (p + p.T)).tolist())
        return Pose(x, y, wrap_angle(heading)), spread, good

    def _probability_good(self, innovation: Floats, s: Floats) -> float:
        """Bayes' rule for two cases: N(innovation; 0, S) if good, uniform over the floor if an outlier."""
        half_nis = 0.5 * float(innovation @ np.linalg.solve(s, innovation))
        peak = 1.0 / (math.tau * math.sqrt(float(np.linalg.det(s))))
        prior_odds = self._outlier_probability / (1.0 - self._outlier_probability)
        odds = prior_odds * self._outlier_density / peak * math.exp(min(half_nis, LARGEST_EXPONENT))
        return 1.0 / (1.0 + odds)
