"""Odometry alone: the floor that every other estimator must beat.

Its covariance holds the white noise of the increments and the calibration errors that stay the same for the whole
run, by their first-order effect on the path so far (Borenstein & Feng 1996: systematic errors dominate indoors).
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from fusion import (
    Covariance,
    Estimate,
    Fate,
    Increment,
    OdometryNoise,
    Pose,
    Prior,
    Radio,
    Reason,
    Tag,
    World,
    compose,
    unusable,
)
from fusion.belief import HEADING_KNOWN_STD, starting_belief


class State(NamedTuple):
    """The start of the run, and the whole motion since as one increment."""

    pose: Pose
    covariance: Covariance
    drive: Increment
    position_known: bool


class DeadReckoning:
    """Dead reckoning from the prior pose. Radio readings are unusable to it."""

    summary: ClassVar[str] = "odometry alone"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.NO_RADIO})

    def __init__(self, world: World) -> None:
        self._world = world
        self._noise = world.robot.noise

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior, no motion yet."""
        return State(*starting_belief(self._world, prior), Increment(), prior.position_known)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Drive on."""
        fates = () if scan is None else unusable(scan, Reason.KIND_NOT_CONSUMED)
        return state._replace(drive=state.drive.then(motion)), fates

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The start pose composed with the whole drive; not valid when the start position is unknown."""
        drive = _with_calibration(state.drive.then(motion), self._noise)
        pose, covariance = compose(state.pose, state.covariance, drive)
        known = covariance.hh < HEADING_KNOWN_STD**2
        return Estimate(time_ns, pose, covariance, valid=state.position_known, heading_known=known)


def _with_calibration(motion: Increment, noise: OdometryNoise) -> Increment:
    """The motion with its calibration errors as further covariance: sum of sigma^2 J Jᵀ over the three of them."""
    columns = (
        (noise.distance_scale_std, (motion.x, motion.y, 0.0)),
        (noise.turn_scale_std, (motion.x_by_scale, motion.y_by_scale, motion.heading)),
        (noise.turn_bias_std_rad_s, (motion.x_by_bias, motion.y_by_bias, motion.duration_s)),
    )
    xx, xy, xh, yy, yh, hh = motion.covariance
    for std, (x, y, h) in columns:
        v = std * std
        xx, xy, xh = xx + v * x * x, xy + v * x * y, xh + v * x * h
        yy, yh, hh = yy + v * y * y, yh + v * y * h, hh + v * h * h
    return motion._replace(covariance=Covariance(xx, xy, xh, yy, yh, hh))
