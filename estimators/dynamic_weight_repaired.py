"""The dynamic weight allocation of Moro & Mehrpouyan (2019) with its outlier rule repaired; the weights stay theirs.

As published, a fix is an outlier when it differs from odometry by more than a percentage of a coordinate. That depends
on where the origin lies, and once odometry has drifted past the gate every good fix is an outlier for ever. Here the
gate is the chi-square test of the difference against both covariances (Bar-Shalom, Li & Kirubarajan 2001, section
5.4.2), and each outlier in a row widens it by one more standard deviation's worth, so that odometry which contradicts
every fix loses its veto.

The average moves the position alone, as the paper's does. Its covariance is that of the fixed gain it is,
(I - K H) P (I - K H)ᵀ + K R Kᵀ with K = w_Wi-Fi [I 0]ᵀ. It holds as far as fixes are independent and the world's noise
is true; calibration errors of odometry are not in it.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from estimators.dynamic_weight import allocate, weighted_average
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
)
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.fates import fix_fates
from fusion.position_fix import Recent, fix_from, fix_innovation, remember
from fusion.trilateration import Fix
from fusion.values import nanoseconds


class State(NamedTuple):
    """Pose and covariance at the last epoch, the counter, and readings waiting for a fix."""

    pose: Pose
    covariance: Covariance
    odo_counter: int
    recent: Recent
    position_known: bool


class DynamicWeightRepaired:
    """The paper's weighted average behind a gate that knows its covariances.

    Parameters
    ----------
    gate_probability
        Share of good fixes that the gate lets through at a counter of zero.
    widening
        How much each outlier in a row widens the gate: its half-width is multiplied by 1 + widening * odoCounter.
        0 keeps the gate as it is, and the lock-out with it.
    epsilon
        odoCounter from which odometry counts as not credible.
    raised_weight
        w_Wi-Fi after "increase w_Wi-Fi and reduce w_odo".
    window_s
        How long readings wait for those of other anchors to make a fix [s]; each reading is used once.
    """

    summary: ClassVar[str] = "dynamic weight allocation, its outlier gate from covariances"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.GLOBAL_START})

    def __init__(
        self,
        world: World,
        *,
        gate_probability: float = 0.99,
        widening: float = 1.0,
        epsilon: int = 3,
        raised_weight: float = 0.75,
        window_s: float = 2.5,
    ) -> None:
        if not 0.0 < gate_probability < 1.0 or not 0.5 <= raised_weight <= 1.0 or min(widening, epsilon, window_s) < 0:
            raise ParameterError(
                "dynamic_weight_repaired: gate_probability must be in (0, 1), raised_weight in [0.5, 1], widening, "
                f"epsilon and window_s not negative; got {gate_probability}, {raised_weight}, {widening}, {epsilon}, "
                f"{window_s}"
            )
        self._world = world
        # The chi-square quantile of two degrees of freedom has a closed form.
        self._gate = -2.0 * float(np.log1p(-gate_probability))
        self._widening = widening
        self._epsilon = epsilon
        self._raised_weight = raised_weight
        self._window_ns = nanoseconds(window_s)

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """Algorithm 1, lines 1 and 2."""
        return State(*starting_belief(self._world, prior), 0, (), prior.position_known)

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
        wifi_weight, counter = self.weigh(state, pose, covariance, fix)
        outlier = wifi_weight == 0.0
        verdict = (Decision.REJECTED, Reason.OUTLIER) if outlier else (Decision.USED, Reason.OK)
        belief = (pose, covariance) if state.position_known else None
        fates = fix_fates(scan, seen, self._world.robot, belief, verdict, wifi_weight)
        fused = average(pose, covariance, fix, wifi_weight, self._world)
        return State(*fused, counter, (), position_known=True), fates

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The pose after the motion since; not valid from an unknown position before the first fix."""
        pose, covariance = compose(state.pose, state.covariance, motion)
        known = covariance.hh < HEADING_KNOWN_STD**2
        return Estimate(time_ns, pose, covariance, valid=state.position_known, heading_known=known)

    def weigh(self, state: State, pose: Pose, covariance: Covariance, fix: Fix) -> tuple[float, int]:
        """w_Wi-Fi and the new odoCounter. From an unknown position, the first fix is believed whole."""
        if not state.position_known:
            return 1.0, 0
        innovation, h = fix_innovation(pose, fix, self._world.robot)
        spread = h @ np.array(covariance.matrix) @ h.T + np.array(fix.matrix)
        nis = float(innovation @ np.linalg.solve(spread, innovation))
        outlier = nis > self._gate * (1.0 + self._widening * state.odo_counter) ** 2
        return allocate(state.odo_counter, self._epsilon, self._raised_weight, outlier=outlier)


def average(pose: Pose, covariance: Covariance, fix: Fix, wifi_weight: float, world: World) -> tuple[Pose, Covariance]:
    """Eq. 5 and the covariance of its result: a filter of that gain, whether optimal or not (Joseph's form)."""
    innovation, h = fix_innovation(pose, fix, world.robot)
    target = (pose.x + float(innovation[0]), pose.y + float(innovation[1]))
    gain = wifi_weight * np.eye(3, 2)
    left = np.eye(3) - gain @ h
    p = left @ np.array(covariance.matrix) @ left.T + gain @ np.array(fix.matrix) @ gain.T
    spread = Covariance.from_matrix((0.5 * (p + p.T)).tolist())
    return Pose(*weighted_average((pose.x, pose.y), target, wifi_weight), pose.heading), spread
