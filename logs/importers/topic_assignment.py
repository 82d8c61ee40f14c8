"""Assignment of a bag's topics to roles: by the user, or by type where only one topic can be meant.

Nothing is guessed: what could be two topics is refused with both named. The truth is never found by its type, because
a goal or another filter's estimate looks just the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fusion import World
from fusion.errors import ParameterError, did_you_mean
from fusion.robot import WHEELS
from logs.importers import foxglove
from logs.importers.bag import TRANSFORM_TYPES, Bag, Topic
from logs.importers.increments import wheel_joints
from logs.importers.samples import IMU, JOINTS, ODOMETRY, POSE, POSE_WITH_COVARIANCE, RANGE, RANGES, WIFI

ROLES: Mapping[str, tuple[str, ...]] = {
    "odom": (ODOMETRY,),
    "wheels": (JOINTS,),
    "gyro": (IMU,),
    "range": (RANGE, RANGES),
    "wifi": (WIFI,),
    "truth": (POSE, POSE_WITH_COVARIANCE, ODOMETRY, foxglove.POSE_IN_FRAME, *TRANSFORM_TYPES),
}
"""Roles, and the types that can play each."""
ANCHOR = "range."
"""Prefix of a role for the ranges of one anchor; its name follows."""
NO_TOPIC = "none"
"""Stands for a topic where a role is to stay empty."""
FRAMES = "tf:"
"""Prefix of a truth that is a transform: ``tf:map>base_link``."""
AS_FRAMES = "write it as 'truth=tf:map>base_link', in quotes: a shell takes > for itself"


@dataclass
class TopicAssignment:
    """Topics by role; a role that stays empty is missing."""

    topics: dict[str, Topic] = field(default_factory=dict)
    """The one topic of a role: odom, wheels, gyro, wifi, truth."""
    joints: tuple[str, ...] = ()
    """The joints that are wheels, in the wheel order of the world."""
    ranges: list[tuple[str, str]] = field(default_factory=list)
    """Topics of ranges, each with the anchor it is of; "" where its messages name it."""
    transforms: list[str] = field(default_factory=list)
    """Topics of transforms that hold the truth, and ``frames``, the one of them."""
    frames: str = ""

    @property
    def used(self) -> list[str]:
        """Names of all topics that play a role."""
        return [*(topic.name for topic in self.topics.values()), *(name for name, _ in self.ranges), *self.transforms]

    def __str__(self) -> str:
        """The roles as they would be named."""
        wheels = {"wheels": f":{','.join(self.joints)}"}
        single = [f"{role}={topic.name}{wheels.get(role, '')}" for role, topic in self.topics.items()]
        ranges = [f"{ANCHOR + anchor if anchor else 'range'}={name}" for name, anchor in self.ranges]
        return " ".join([*single, *ranges, *([f"truth={FRAMES}{self.frames}"] if self.frames else [])])


def roles_of(topic: Topic) -> list[str]:
    """The roles that a topic could play, going by its type."""
    return [role for role, kinds in ROLES.items() if topic.understood and topic.type in kinds]


def truth_frames(topics: Mapping[str, str]) -> tuple[str, str] | None:
    """Parent and child frame of a truth given as a transform, else None; raises `ParameterError`."""
    asked = topics.get("truth", "")
    if not asked.startswith(FRAMES):
        return None
    parent, _, child = (frame.strip("/ ") for frame in asked.removeprefix(FRAMES).partition(">"))
    if not parent or not child:
        raise ParameterError(f"truth: {asked!r} does not name two frames; {AS_FRAMES}")
    return parent, child


def assign(bag: Bag, world: World, topics: Mapping[str, str]) -> TopicAssignment:
    """Assign a topic to every role; raises `ParameterError` for what the bag has not, or has more than once."""
    assignment = TopicAssignment()
    for role, asked in topics.items():
        _check_role(role, world)
        if asked != NO_TOPIC:
            _assign_named(assignment, bag, role, asked)
    if "odom" in assignment.topics and "wheels" in assignment.topics:
        raise ParameterError(f"{bag.path}: odom and wheels are both named, and would count the motion twice; leave one")
    used = assignment.used
    for name in used:
        if used.count(name) > 1:
            raise ParameterError(f"{bag.path}: {name} is named for two roles; each needs a topic of its own")
    free = [topic for topic in bag.topics.values() if topic.count and topic.understood and topic.name not in used]
    _assign_by_type(assignment, bag, world, topics, free)
    if "wheels" in assignment.topics:
        assignment.joints = wheel_joints(assignment.topics["wheels"], assignment.joints, world.robot)
    return assignment


def _check_role(role: str, world: World) -> None:
    anchor = role.removeprefix(ANCHOR)
    if role.startswith(ANCHOR) and world.anchor(anchor) is None:
        ids = [anchor.id for anchor in world.anchors]
        raise ParameterError(f"{role}: the world has no anchor {anchor!r}; {did_you_mean(anchor, ids)}")
    if not role.startswith(ANCHOR) and role not in ROLES:
        raise ParameterError(f"there is no role {role!r}; {did_you_mean(role, [*ROLES, ANCHOR + 'ANCHOR'])}")


def _assign_named(assignment: TopicAssignment, bag: Bag, role: str, asked: str) -> None:
    """Assign the topic that was named for a role."""
    if role == "truth" and asked.startswith(FRAMES):
        assignment.frames = ">".join(truth_frames({role: asked}) or ())
        assignment.transforms = _transforms(bag, assignment.frames)
        return
    name, _, joints = asked.partition(":") if role == "wheels" else (asked, "", "")
    kinds = (RANGE,) if role.startswith(ANCHOR) else ROLES[role]
    topic = _named(bag, role, name, kinds)
    if role.startswith(ANCHOR) or role == "range":
        assignment.ranges.append((name, role.removeprefix(ANCHOR) if role.startswith(ANCHOR) else ""))
    else:
        assignment.topics[role] = topic
        assignment.joints = tuple(joint.strip() for joint in joints.split(",")) if joints else assignment.joints


def _named(bag: Bag, role: str, name: str, kinds: tuple[str, ...]) -> Topic:
    """The topic of that name, if it can play the role."""
    if name not in bag.topics:
        raise ParameterError(f"{bag.path}: {role}: there is no topic {name!r}; {did_you_mean(name, bag.topics)}")
    topic = bag.topics[name]
    if topic.type in TRANSFORM_TYPES and role == "truth":
        pairs = ", ".join(sorted(topic.names))
        raise ParameterError(f"{bag.path}: truth: {name} holds transforms ({pairs}); name one: {AS_FRAMES}")
    if topic.type not in kinds:
        raise ParameterError(f"{bag.path}: {role}: {name} is of the type {topic.type}, and not {' or '.join(kinds)}")
    if not topic.understood:
        raise ParameterError(f"{bag.path}: {role}: {name} is packed as {topic.encoding!r}, which is not read here")
    if topic.missing:
        raise ParameterError(f"{bag.path}: {role}: {name} cannot be read; {topic.missing}")
    if not topic.count:
        raise ParameterError(f"{bag.path}: {role}: {name} holds no message; leave the role out with {role}={NO_TOPIC}")
    return topic


def _transforms(bag: Bag, pair: str) -> list[str]:
    """Every topic that holds the transform ``parent>child``."""
    all_transforms = [topic for topic in bag.topics.values() if topic.type in TRANSFORM_TYPES]
    names = [topic.name for topic in all_transforms if pair in topic.names]
    if not names:
        pairs = {name for topic in all_transforms for name in topic.names}
        hint = next((topic.missing for topic in all_transforms if topic.missing), "") or did_you_mean(pair, pairs)
        raise ParameterError(f"{bag.path}: truth: no message transforms {pair} (transforms are not chained); {hint}")
    return names


def _assign_by_type(
    assignment: TopicAssignment, bag: Bag, world: World, topics: Mapping[str, str], free: Sequence[Topic]
) -> None:
    """Fill the roles without a named topic, but for the truth. Motion counts once: that of the odometry first."""
    for role in ("odom", "wheels", "gyro", "wifi"):
        moves = role in ("odom", "wheels") and ("odom" in assignment.topics or "wheels" in assignment.topics)
        has_wheels = bool(WHEELS[world.robot.drive])
        if role in topics or moves or (role == "wheels" and not has_wheels):
            continue
        candidates = [topic for topic in free if topic.type in ROLES[role]]
        if len(candidates) > 1:
            raise _ambiguous(bag, role, [topic.name for topic in candidates])
        if candidates:
            assignment.topics[role] = candidates[0]
    if "range" not in topics:
        named = {role.removeprefix(ANCHOR) for role in topics}
        assignment.ranges += _anchored(bag, {anchor.id for anchor in world.anchors} - named, free)


def _anchored(bag: Bag, anchors: set[str], free: Sequence[Topic]) -> list[tuple[str, str]]:
    """Topics whose ranges are of these anchors only: a sonar's are not."""
    topics = [topic for topic in free if topic.type in ROLES["range"] and topic.names and topic.names <= anchors]
    for anchor in sorted(anchors):
        rivals = [topic.name for topic in topics if anchor in topic.names]
        if len(rivals) > 1:
            raise _ambiguous(bag, ANCHOR + anchor, rivals)
    return [(topic.name, "") for topic in topics]


def _ambiguous(bag: Bag, role: str, names: Sequence[str]) -> ParameterError:
    return ParameterError(
        f"{bag.path}: {role} could be {' or '.join(names)}; choose one with {role}={names[0]}, or {role}={NO_TOPIC}"
    )
