"""Promises of position and heading: the estimate follows the robot, whatever the frame of the map and the start."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from fusion.conformance.folds import EXACT_M, NEAR_M, NEAR_RAD, NOISELESS, NOISY, at, brief, distance, updates_of
from fusion.conformance.promise import Promise, promise, require
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.estimator import Tag
from fusion.geometry import Pose, wrap_angle
from fusion.values import nanoseconds

PROMISES: list[Promise] = []
SETTLED_NS = nanoseconds(5.0)
"""Time in which an estimator settles."""


@promise(PROMISES, "no-jump-at-pi", "The heading follows the robot across ±pi.", unless=[Tag.NO_HEADING])
def _no_jump_at_pi(made: type[Any]) -> None:
    for run in (
        SyntheticRun(duration_s=30.0),
        SyntheticRun(duration_s=30.0, start=Pose(5.0, 6.0, 0.0), turn_rate_rad_s=-0.25),
    ):
        for update in updates_of(made, run):
            truth = run.pose(update.estimate.time_ns).heading
            off = abs(wrap_angle(update.estimate.pose.heading - truth))
            require(off < NEAR_RAD, f"{at(update)} the heading is {brief(update.estimate)}, in truth {truth:.3f}")


@promise(PROMISES, "small-error", "Without noise the error is small.")
def _small_error(made: type[Any]) -> None:
    for update in updates_of(made, NOISELESS):
        off = distance(update.estimate.pose, NOISELESS.pose(update.estimate.time_ns), heading=False)
        require(
            update.estimate.time_ns < SETTLED_NS or (update.estimate.valid and off < NEAR_M),
            f"{at(update)} the error is {off:.3f} m" + ("" if update.estimate.valid else ", and it is not valid"),
        )


@promise(PROMISES, "world-turns", "Turn and move the world, and the answer turns and moves with it.")
def _world_turns(made: type[Any]) -> None:
    moved = replace(NOISY, map_from_room=Pose(3.0, -7.0, 0.5 * math.pi))
    with_heading = Tag.NO_HEADING not in made.tags
    chance = Tag.STOCHASTIC in made.tags
    for one, other in zip(updates_of(made, NOISY), updates_of(made, moved), strict=True):
        expected = moved.map_from_room.compose(one.estimate.pose)
        off = distance(other.estimate.pose, expected, heading=with_heading)
        require(
            off < (NEAR_RAD if chance else EXACT_M) or not one.estimate.valid,
            f"{at(one)} the pose should turn to {brief(one.estimate._replace(pose=expected))}, "
            f"it is {brief(other.estimate)}, off by {off:.3g}",
        )


@promise(
    PROMISES, "forward-is-forward", "Driving forward goes forward, by the distance driven.", unless=[Tag.NO_HEADING]
)
def _forward_is_forward(made: type[Any]) -> None:
    straight = SyntheticRun(8.0, turn_rate_rad_s=0.0, start=Pose(2.0, 2.0, 0.6), radio_until_s=0.0)
    last = updates_of(made, straight)[-1].estimate
    back = straight.pose(0).inverse().compose(last.pose)
    require(
        math.hypot(back.x - 4.0, back.y) < 0.2, f"after 4 m straight on, the pose is ({back.x:.3f}, {back.y:.3f}) m"
    )


@promise(PROMISES, "unknown-heading", "An unknown heading is not called known before it is.", unless=[Tag.NO_HEADING])
def _unknown_heading(made: type[Any]) -> None:
    # The heading of such a prior means nothing; a wrong one shows whether it was used.
    run = replace(NOISELESS, start=Pose(5.0, 2.0, 0.8))
    start = run.prior()
    lying = replace(start, heading_known=False, pose=start.pose._replace(heading=-2.0))
    updates = updates_of(made, run, prior=lying)
    require(not updates[0].estimate.heading_known, "the start heading is unknown, yet reported known at once")
    for update in updates:
        estimate = update.estimate
        off = abs(wrap_angle(estimate.pose.heading - run.pose(estimate.time_ns).heading))
        require(
            not estimate.heading_known or off < 1.0, f"{at(update)} the heading is called known, off by {off:.3f} rad"
        )
    resolves = Tag.HEADING_START in made.tags
    require(
        updates[-1].estimate.heading_known or not resolves,
        "it is tagged heading_start, yet the heading is not known after 20 s of clean data",
    )


@promise(
    PROMISES, "global-start", "An estimator that claims to start anywhere finds the robot.", needs=[Tag.GLOBAL_START]
)
def _global_start(made: type[Any]) -> None:
    unknown = replace(NOISELESS.prior(), position_known=False)
    last = updates_of(made, NOISELESS, prior=replace(unknown, pose=Pose(-1.0, 9.0, 0.0)))[-1].estimate
    off = distance(last.pose, NOISELESS.pose(last.time_ns), heading=False)
    require(last.valid and off < NEAR_M, f"from an unknown position, the error after 20 s is {off:.3f} m")
