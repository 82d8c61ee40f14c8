"""Trilateration without memory or motion: the position by radio alone (Moro & Mehrpouyan 2019, eqs. 1 and 2)."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

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
    radio_readings,
    unusable,
)
from fusion.position_fix import Recent, fix_from, remember
from fusion.trilateration import Fix
from fusion.values import nanoseconds

MAX_FIX_AGE_NS = nanoseconds(1.0)
"""Age from which a fix is no longer an answer."""
NO_HEADING_VARIANCE = 3.3
"""Variance of a heading of which nothing is known: (2 pi)^2 / 12 [rad^2]."""


class State(NamedTuple):
    """Readings of the last moments, and the last fix made from them."""

    recent: Recent
    fix: Fix | None
    fix_ns: int


class RadioOnly:
    """Memoryless trilateration; the antenna's position, since without a heading its lever arm cannot be taken off.

    Parameters
    ----------
    window_s
        How long a reading is remembered until readings of other anchors join it [s]. Radios that range to one anchor
        at a time need it; a Wi-Fi scan measures all at once.
    clamp_to_bounds
        Whether a fix beyond the floor is moved to its edge.
    """

    summary: ClassVar[str] = "trilateration without memory"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.NO_HEADING, Tag.NOT_ROBUST, Tag.GLOBAL_START})

    def __init__(self, world: World, *, window_s: float = 2.5, clamp_to_bounds: bool = True) -> None:
        if window_s < 0.0:
            raise ParameterError(f"radio_only: window_s is {window_s}; give zero or more seconds")
        self._world = world
        self._window_ns = nanoseconds(window_s)
        self._clamp = clamp_to_bounds

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - a memoryless method has no prior
        """No reading yet."""
        return State((), None, prior.time_ns)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:  # noqa: ARG002
        """Make a fix from the latest readings, if they are of three anchors at least."""
        if scan is None:
            return state, ()
        recent = remember(state.recent, scan.time_ns, radio_readings(self._world, scan), self._window_ns)
        fix = fix_from(recent, self._world.robot)
        if isinstance(fix, Reason):
            return state._replace(recent=recent), unusable(scan, fix)
        who = (scan.time_ns, scan.sensor, scan.seq)
        fates = tuple(Fate(*who, r.anchor, Decision.USED, Reason.OK, 1.0) for r in scan.readings)
        return State(recent, self._clamped(fix), scan.time_ns), fates

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:  # noqa: ARG002 - without motion
        """The last fix; not valid before the first, nor a second after the last."""
        if state.fix is None:
            return Estimate(time_ns, Pose(0.0, 0.0, 0.0), None, valid=False, heading_known=False)
        x, y, xx, xy, yy = state.fix
        covariance = Covariance(xx, xy, 0.0, yy, 0.0, NO_HEADING_VARIANCE)
        fresh = time_ns - state.fix_ns <= MAX_FIX_AGE_NS
        return Estimate(time_ns, Pose(x, y, 0.0), covariance, valid=fresh, heading_known=False)

    def _clamped(self, fix: Fix) -> Fix:
        bounds = self._world.bounds
        if not self._clamp:
            return fix
        x = min(max(fix.x, bounds.x_min), bounds.x_max)
        return fix._replace(x=x, y=min(max(fix.y, bounds.y_min), bounds.y_max))
