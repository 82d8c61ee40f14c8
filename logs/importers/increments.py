"""Odometry increments from what robots publish: poses that add up since the start, angles of wheels.

Messages are chained in the order of their stamps, each with the one before; an increment has arrived when both of its
ends have. Where the robot would have moved faster than any robot here can, its odometry was started anew: the motion
of that time counts as not measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeVar

from fusion import Odometry
from fusion.errors import ParameterError, did_you_mean
from fusion.odometry import MAX_WHEEL_SPEED_M_S, LinearDistance, wheel_increment
from fusion.robot import WHEELS, Robot
from fusion.values import seconds
from logs.importers.bag import Topic
from logs.importers.samples import JointSample, PoseSample, Sample

SHORTEST_SPAN_S = 0.1
"""Stamps that lie closer than this are too rough for a speed."""
SIDEWAYS_SHARE = 0.05
"""Sideways motion worth a warning, as a share of the path."""


class Increments(NamedTuple):
    """Odometry with the time each increment arrived [ns], and what is wrong with it."""

    rows: list[tuple[int, Odometry]]
    warnings: list[str]


class Motion(NamedTuple):
    """From one sample to the next: distance forward [m], turn [rad], way sideways [m], farthest that any part moved
    [m].
    """

    distance_m: float
    turn_rad: float
    sideways_m: float
    farthest_m: float


Stamped = TypeVar("Stamped", PoseSample, JointSample)


def pose_increments(topic: Topic) -> Increments:
    """Differences of the poses of a nav_msgs/Odometry, in the robot's frame; the twist is not used.

    The distance is the way along the heading half-way through the turn, so that adding the increments up by the
    mid-point rule (`fusion.Increment`) gives the robot's own poses back, if it moves along arcs. A robot that moves
    sideways loses that part, and poses without a heading or a position are left out; warnings count both.
    """

    def motion(before: PoseSample, after: PoseSample) -> Motion:
        x, y, turn = before.pose.inverse().compose(after.pose)
        c, s = math.cos(0.5 * turn), math.sin(0.5 * turn)
        return Motion(c * x + s * y, turn, abs(c * y - s * x), math.hypot(x, y))

    poses = _in_order(topic.samples, PoseSample)
    whole = [(arrived_ns, pose) for arrived_ns, pose in poses if pose.is_whole]
    chained = _chain(topic.name, whole, motion)
    if len(whole) < len(poses):
        missing = len(poses) - len(whole)
        chained.warnings.append(
            f"{topic.name}: {missing} of {len(poses)} poses lack heading or position, and are left out"
        )
    return chained


def wheel_increments(topic: Topic, joints: Sequence[str], robot: Robot) -> Increments:
    """Motion from the turning of wheels, by their circumference and track, with the world's distance calibration.

    Not as ticks: angles are finer than the world's ticks, and would be rounded to them. Messages without one of the
    joints are passed over.
    """
    metres_per_radian = robot.wheel_circumference_m / math.tau
    calibration = LinearDistance(robot.distance_scale, robot.distance_offset_m)
    moving = False

    def motion(before: JointSample, after: JointSample) -> Motion:
        nonlocal moving
        rolled = [metres_per_radian * (after.angles[joint] - before.angles[joint]) for joint in joints]
        distance, turn = wheel_increment(robot, rolled)
        distance = calibration.true_step(distance, moving=moving)
        moving = bool(distance)
        return Motion(distance, turn, 0.0, max(map(abs, rolled)))

    whole = [row for row in topic.samples if isinstance(row[1], JointSample) and row[1].angles.keys() >= set(joints)]
    return _chain(topic.name, _in_order(whole, JointSample), motion)


def wheel_joints(topic: Topic, named: Sequence[str], robot: Robot) -> tuple[str, ...]:
    """The joints that are wheels, in the wheel order of the world: as named, or known by the words in their names.

    Raises `ParameterError` where they cannot be known.
    """
    wheels = [name.split("_") for name in WHEELS[robot.drive]]
    if not wheels:
        raise ParameterError(f"wheels: the world's robot has none (robot.drive is {robot.drive!r}); correct it")
    by_words = [[name for name in topic.names if all(word in name.lower() for word in words)] for words in wheels]
    joints = tuple(named) or tuple(names[0] for names in by_words if len(names) == 1)
    for joint in joints:
        if joint not in topic.names:
            raise ParameterError(f"wheels: {topic.name} has no joint {joint!r}; {did_you_mean(joint, topic.names)}")
    if len(joints) != len(wheels):
        raise ParameterError(
            f"wheels: which joints of {topic.name} ({', '.join(sorted(topic.names)) or 'it names none'}) are the "
            f"wheels ({', '.join(map(' '.join, wheels))})? Name them: wheels={topic.name}:JOINT,..."
        )
    return joints


def _in_order(rows: Sequence[tuple[int, Sample]], kind: type[Stamped]) -> list[tuple[int, Stamped]]:
    """Samples in the order of their stamps; of two with one stamp, the first to arrive."""
    first: dict[int, tuple[int, Stamped]] = {}
    for arrived_ns, sample in sorted(rows, key=lambda row: row[0]):
        if isinstance(sample, kind):
            first.setdefault(sample.time_ns, (arrived_ns, sample))
    return [first[time_ns] for time_ns in sorted(first)]


def _chain(
    sensor: str, samples: Sequence[tuple[int, Stamped]], motion: Callable[[Stamped, Stamped], Motion]
) -> Increments:
    rows: list[tuple[int, Odometry]] = []
    jumps, sideways_m, path_m = 0, 0.0, 0.0
    for number, ((arrived_before_ns, before), (arrived_ns, after)) in enumerate(pairwise(samples)):
        moved = motion(before, after)
        span_s = seconds(after.time_ns - before.time_ns)
        if moved.farthest_m > MAX_WHEEL_SPEED_M_S * max(span_s, SHORTEST_SPAN_S):
            jumps += 1
            driven = (0.0, 0.0, False)
        else:
            sideways_m += moved.sideways_m
            path_m += abs(moved.distance_m)
            driven = (moved.distance_m, moved.turn_rad, True)
        increment = Odometry(after.time_ns, sensor, number, before.time_ns, *driven)
        rows.append((max(arrived_before_ns, arrived_ns), increment))
    warnings = [f"{sensor}: jumps {jumps} times, as if started anew; that motion is not measured"] if jumps else []
    if sideways_m > SIDEWAYS_SHARE * path_m:
        warnings.append(
            f"{sensor}: {sideways_m:.2f} m of sideways motion are left out, {path_m:.2f} m forward are kept"
        )
    return Increments(rows, warnings)
