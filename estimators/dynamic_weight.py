"""The dynamic weight-allocation algorithm, as published (Moro & Mehrpouyan 2019, Algorithms 1 and 2, eq. 5).

The paper leaves some things open. Each is a named parameter whose default is the most literal reading; nothing else is
added. The method claims no covariance, so its estimates carry none.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

from fusion import (
    Decision,
    Estimate,
    Fate,
    Increment,
    ParameterError,
    Pose,
    Prior,
    Radio,
    RadioReading,
    Reason,
    Tag,
    World,
    radio_readings,
    unusable,
    wrap_angle,
)
from fusion.belief import starting_belief
from fusion.errors import did_you_mean
from fusion.fates import fix_fates
from fusion.position_fix import Recent, fix_from, remember
from fusion.trilateration import Fix
from fusion.values import nanoseconds

OUTLIER_SCALES = ("coordinate", "position", "travelled", "floor")
MISSING = ("ignore", "count")


class State(NamedTuple):
    """Fused position, odometry position and heading, both weights, the counter, and readings waiting for a fix."""

    fused: Pose
    odometry: Pose
    wifi_weight: float
    odo_counter: int
    travelled_m: float
    recent: Recent
    position_known: bool
    heading_known: bool


def allocate(odo_counter: int, epsilon: int, raised_weight: float, *, outlier: bool) -> tuple[float, int]:
    """Algorithm 2: w_Wi-Fi and the new odoCounter; w_odo is 1 - w_Wi-Fi (its "require")."""
    if odo_counter >= epsilon and not outlier:  # line 1
        return raised_weight, 0  # lines 2 and 3
    if not outlier:  # line 4
        return 0.5, 0  # lines 5 and 6
    return 0.0, odo_counter + 1  # lines 7 to 9


def weighted_average(
    odometry: tuple[float, float], wifi: tuple[float, float], wifi_weight: float
) -> tuple[float, float]:
    """Eq. 5: x = x_odo w_odo + x_Wi-Fi w_Wi-Fi, and the same for y."""
    odo_weight = 1.0 - wifi_weight
    return (odometry[0] * odo_weight + wifi[0] * wifi_weight, odometry[1] * odo_weight + wifi[1] * wifi_weight)


class DynamicWeight:
    """The paper's weighted average of odometry and Wi-Fi fix.

    Parameters
    ----------
    outlier_percent
        xi: a fix that differs from the odometry position by more is an outlier [%].
    outlier_relative_to
        Percent of what: each ``coordinate`` of the odometry position (the literal reading), the norm of the
        ``position``, the distance ``travelled``, or the diagonal of the ``floor``.
    epsilon
        odoCounter from which odometry counts as not credible.
    raised_weight
        w_Wi-Fi after "increase w_Wi-Fi and reduce w_odo".
    feedback
        Whether each odometry step starts from the fused location ("using the previous location of the robot").
    missing_wifi
        Whether a scan without a fix leaves the counter alone (``ignore``) or raises it (``count``).
    window_s
        How long readings wait for those of other anchors to make a fix [s]; each reading is used once.
    """

    summary: ClassVar[str] = "dynamic weight allocation of Moro & Mehrpouyan (2019)"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.NO_COVARIANCE})

    def __init__(
        self,
        world: World,
        *,
        outlier_percent: float = 10.0,
        outlier_relative_to: str = "coordinate",
        epsilon: int = 3,
        raised_weight: float = 0.75,
        feedback: bool = True,
        missing_wifi: str = "ignore",
        window_s: float = 2.5,
    ) -> None:
        for name, value, known in (
            ("outlier_relative_to", outlier_relative_to, OUTLIER_SCALES),
            ("missing_wifi", missing_wifi, MISSING),
        ):
            if value not in known:
                raise ParameterError(f"dynamic_weight: {name} is {value!r}; {did_you_mean(value, known)}")
        if outlier_percent <= 0.0 or not 0.5 <= raised_weight <= 1.0 or epsilon < 0 or window_s < 0.0:
            raise ParameterError(
                "dynamic_weight: outlier_percent must be positive, raised_weight in [0.5, 1], epsilon and window_s not "
                f"negative; got {outlier_percent}, {raised_weight}, {epsilon}, {window_s}"
            )
        self._world = world
        self._share = outlier_percent / 100.0
        self._relative_to = outlier_relative_to
        self._epsilon = epsilon
        self._raised_weight = raised_weight
        self._feedback = feedback
        self._count_missing = missing_wifi == "count"
        self._window_ns = nanoseconds(window_s)

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """Algorithm 1, lines 1 and 2: both weights 0.5, counter 0, odometry at the start; anchors given."""
        pose, _ = starting_belief(self._world, prior)
        return State(pose, pose, 0.5, 0, 0.0, (), prior.position_known, prior.heading_known)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Odometry moves both positions; a fix is weighed in."""
        state = self._moved(state, motion)
        if scan is None:
            return state, ()
        seen = radio_readings(self._world, scan)
        recent = remember(state.recent, scan.time_ns, seen, self._window_ns)
        fix = fix_from(recent, self._world.robot)  # Algorithm 1, line 4
        if isinstance(fix, Reason):
            counter = state.odo_counter + int(self._count_missing)
            return state._replace(recent=recent, odo_counter=counter), unusable(scan, fix)
        return self._fuse(state, self._base(fix, state), scan, seen)

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The fused position with odometry's heading; no covariance is claimed."""
        fused = self._moved(state, motion).fused
        return Estimate(time_ns, fused, None, valid=state.position_known, heading_known=state.heading_known)

    def _moved(self, state: State, motion: Increment) -> State:
        """Algorithm 1, line 3: (x_odo, y_odo) from the wheels and the previous location."""
        travelled = state.travelled_m + motion.path_m
        moved = state._replace(fused=state.fused.compose(motion.pose), travelled_m=travelled)
        return moved._replace(odometry=moved.fused if self._feedback else state.odometry.compose(motion.pose))

    def _base(self, fix: Fix, state: State) -> tuple[float, float]:
        """The robot's base for a fix of its antenna, with odometry's heading."""
        forward, left, _ = self._world.robot.antenna_m
        arm_x, arm_y = Pose(0.0, 0.0, state.odometry.heading).transform(forward, left)
        return fix.x - arm_x, fix.y - arm_y

    def _fuse(
        self, state: State, fix: tuple[float, float], scan: Radio, seen: tuple[RadioReading, ...]
    ) -> tuple[State, tuple[Fate, ...]]:
        """Algorithm 1, lines 5 and 6. From an unknown position, odometry starts at the first fix."""
        expected = (state.odometry, None) if state.position_known else None
        if not state.position_known:
            state = state._replace(odometry=Pose(*fix, state.odometry.heading))
        x, y, heading = state.odometry
        outlier = self._is_outlier(fix, (x, y), state.travelled_m)
        # Line 5: the weights, by Algorithm 2.
        wifi_weight, counter = allocate(state.odo_counter, self._epsilon, self._raised_weight, outlier=outlier)
        fused = Pose(*weighted_average((x, y), fix, wifi_weight), wrap_angle(heading))  # line 6
        after = state._replace(
            fused=fused,
            odometry=fused if self._feedback else state.odometry,
            wifi_weight=wifi_weight,
            odo_counter=counter,
            recent=(),
            position_known=True,
        )
        verdict = (Decision.REJECTED, Reason.OUTLIER) if outlier else (Decision.USED, Reason.OK)
        return after, fix_fates(scan, seen, self._world.robot, expected, verdict, wifi_weight)

    def _is_outlier(self, fix: tuple[float, float], odometry: tuple[float, float], travelled_m: float) -> bool:
        """Section III-B: differs from (x_odo, y_odo) by more than xi percent."""
        away = math.dist(fix, odometry)
        if self._relative_to == "coordinate":
            return any(abs(f - o) > self._share * abs(o) for f, o in zip(fix, odometry, strict=True))
        if self._relative_to == "position":
            return away > self._share * math.hypot(*odometry)
        if self._relative_to == "travelled":
            return away > self._share * travelled_m
        bounds = self._world.bounds
        return away > self._share * math.hypot(bounds.x_max - bounds.x_min, bounds.y_max - bounds.y_min)
