"""A ROS 2 bag in MCAP, of anybody's making, as a run. `docs/import.md` lists what each role reads.

The stamp in a message's header is the time it was true, the log time when it arrived. Every measurement carries its
topic as the sensor's name, and is numbered per topic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias, TypeVar

from fusion import Gyro, LogError, Measurement, Pose, RangeReading, Ranges, Truth, WifiScan, World
from fusion.errors import ParameterError
from fusion.timeline import order
from logs.importers.bag import TRANSFORM_TYPES, Bag, Keep, Topic, open_bag
from logs.importers.foreign_recording import Recording
from logs.importers.increments import pose_increments, wheel_increments
from logs.importers.samples import ODOMETRY, PoseSample, RangeSample, Sample
from logs.importers.topic_assignment import ROLES, TopicAssignment, assign, truth_frames
from logs.prior import prior_from_truth
from logs.run import Run
from logs.truth import TruthTrack

TRUTH_IS_MAP = (0.0, 0.0, 0.0)
NOTHING: Mapping[str, str] = MappingProxyType({})
Value = TypeVar("Value")
Arrived: TypeAlias = list[tuple[int, Value]]
"""Values, each after the time it arrived [ns]."""


def read_bag(
    path: Path, world: World, topics: Mapping[str, str] = NOTHING, *, truth_to_map: Sequence[float] = TRUTH_IS_MAP
) -> Run:
    """The run in the bag at ``path``: an MCAP file, or the folder of a rosbag2 recording.

    ``topics`` names the topic of each role: ``odom``, ``wheels``, ``gyro``, ``range``, ``range.ANCHOR``, ``wifi``,
    ``truth``; "none" leaves one out. Others than the truth are found by their type. ``truth_to_map`` is the frame of
    the truth in the map (x [m], y [m], heading [rad]). Raises `LogError` for what holds no run, `ParameterError` for a
    role or topic that there is not, or that could be several.
    """
    recording = read_recording(path, world, topics, truth_to_map=truth_to_map)
    return Run(
        path=path,
        name=recording.name,
        world=world,
        prior=recording.prior,
        metadata=recording.metadata,
        measurements=tuple(recording.measurements),
        truth=TruthTrack.from_truths(recording.truths) or None,
        warnings=tuple(recording.doubts),
        lanes={},
    )


def recordings(
    bag: Path,
    *,
    world: Path | None = None,
    topics: Mapping[str, str] = NOTHING,
    truth_to_map: Sequence[float] = TRUTH_IS_MAP,
) -> Iterator[Recording]:
    """The one run of a bag, as `fusion import rosbag` wants it; raises as `read_bag`."""
    yield read_recording(bag, need_world(world), topics, truth_to_map=truth_to_map)


def need_world(path: Path | None) -> World:
    """The world in a file; raises `ParameterError` when none is given, `WorldError` for one that cannot be read."""
    if path is None:
        raise ParameterError("a bag does not hold the places of its anchors: give --world WORLD.toml (docs/world.md)")
    return World.load(path)


def read_recording(
    path: Path, world: World, topics: Mapping[str, str], *, truth_to_map: Sequence[float] = TRUTH_IS_MAP
) -> Recording:
    """`read_bag`, with the times of arrival."""
    bag = open_bag(path, keep=_keeper(truth_frames(topics)))
    assignment = assign(bag, world, topics)
    measurements, warnings = _measurements(bag, assignment, world)
    truths = _truths(bag, assignment, _frame(truth_to_map))
    if not measurements and not truths:
        held = ", ".join(bag.topics) or "no topics"
        raise LogError(f"{path}: no message of it is of use ({held}); see `fusion info`, and name the topics")
    if not measurements:
        warnings.append("holds no measurements")
    measurements.sort(key=lambda row: (row[0], order(row[1])))
    truths.sort(key=lambda row: row[0])
    doubts = [f"{path}: {doubt}" for doubt in (*_doubts(bag, assignment, world, topics), *warnings)]
    return _recording(path, world, measurements, truths, str(assignment), [*bag.warnings, *doubts])


def _frame(numbers: Sequence[float]) -> Pose:
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ParameterError(f"truth_to_map: {list(numbers)} are not three numbers x [m], y [m], heading [rad]")
    return Pose(*numbers)


def _keeper(frames: tuple[str, str] | None) -> Keep:
    """Of all transforms in a bag only those that are asked for are kept; there can be a great many."""

    def keep(kind: str, sample: Sample) -> bool:
        if kind in TRANSFORM_TYPES and isinstance(sample, PoseSample):
            return (sample.parent, sample.child) == frames
        return True

    return keep


def _recording(
    path: Path,
    world: World,
    measurements: Arrived[Measurement],
    truths: Arrived[Truth],
    assignment: str,
    warnings: Sequence[str],
) -> Recording:
    prior, how = prior_from_truth([m for _, m in measurements], [truth for _, truth in truths])
    metadata = {"source": "rosbag", "topics": assignment, "prior": how}
    if warnings:
        metadata["warnings"] = "\n".join(warnings)
    return Recording(
        name=path.resolve().name.removesuffix(".mcap"),
        world=world,
        prior=prior,
        measurements=[measurement for _, measurement in measurements],
        truths=[truth for _, truth in truths],
        metadata=metadata,
        arrivals_ns=[arrived_ns for arrived_ns, _ in (*measurements, *truths)],
        warnings=warnings,
    )


def _measurements(bag: Bag, assignment: TopicAssignment, world: World) -> tuple[Arrived[Measurement], list[str]]:
    rows: Arrived[Measurement] = []
    warnings: list[str] = []
    for role, topic in assignment.topics.items():
        if role in ("gyro", "wifi"):
            rows += _radio(topic, "")
        elif role != "truth":
            wheels = role == "wheels"
            increments = wheel_increments(topic, assignment.joints, world.robot) if wheels else pose_increments(topic)
            rows += increments.rows
            warnings += increments.warnings
    for name, anchor in assignment.ranges:
        rows += _radio(bag.topics[name], anchor)
    return rows, warnings


def _radio(topic: Topic, anchor: str) -> Arrived[Measurement]:
    """Measurements of a topic's messages; a range by the frame of its message, or the ``anchor`` it is known for."""
    rows: Arrived[Measurement] = []
    for number, (arrived_ns, sample) in enumerate(topic.samples):
        if isinstance(sample, RangeSample):
            reading = RangeReading(anchor or sample.frame, sample.range_m, sample.std_m)
            rows.append((arrived_ns, Ranges(sample.time_ns, topic.name, number, (reading,))))
        elif isinstance(sample, Gyro | WifiScan | Ranges):
            rows.append((arrived_ns, replace(sample, sensor=topic.name, seq=number)))
    return rows


def _truths(bag: Bag, assignment: TopicAssignment, map_from_truth: Pose) -> Arrived[Truth]:
    named = assignment.topics.get("truth")
    topics = [named] if named else [bag.topics[name] for name in assignment.transforms]
    rows = []
    for arrived_ns, sample in (row for topic in topics for row in topic.samples):
        if isinstance(sample, PoseSample):
            x, y, heading = map_from_truth.compose(sample.pose)
            rows.append((arrived_ns, Truth(sample.time_ns, x, y, None if sample.heading is None else heading)))
    return rows


def _doubts(bag: Bag, assignment: TopicAssignment, world: World, topics: Mapping[str, str]) -> Iterator[str]:
    """Warnings of what may be missing or wrong, a sentence each."""
    ids = {anchor.id for anchor in world.anchors}
    named = dict(assignment.ranges)
    for topic in bag.topics.values():
        used = topic.name in assignment.used
        if used and topic.unreadable:
            yield f"{topic.unreadable} messages of {topic.name} cannot be decoded"
        if used and len(topic.samples) > 1 and len({sample.time_ns for _, sample in topic.samples}) == 1:
            yield f"all messages of {topic.name} carry one and the same stamp; let its driver stamp them"
        strangers = ", ".join(sorted(name or '""' for name in topic.names - ids))
        if topic.type in ROLES["range"] and not named.get(topic.name) and strangers:
            yield f"{topic.name} has ranges of what is no anchor of the world ({strangers}); name it range.ANCHOR"
    could = [topic.name for topic in bag.topics.values() if topic.type in ROLES["truth"] and topic.type != ODOMETRY]
    if could and "truth" not in topics:
        yield f"no truth is named, so errors cannot be scored; it may be in {' or '.join(could)}"
