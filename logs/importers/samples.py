"""Messages of foreign topics as a few small values: the standard ROS 2 types, read from CDR.

A sample is the content of a message before a role is assigned to its topic; `logs.importers.rosbag` makes measurements
and truth of it. Fields of no use are passed over. A message that is cut off, or holds no number where one is needed,
raises.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple, TypeAlias

from fusion import Gyro, Pose, Ranges, WifiScan
from logs.cdr import Unpacker
from logs.messages import DECODERS, take_header, take_pose


class PoseSample(NamedTuple):
    """Pose of the frame ``child`` (may be "") in the frame ``parent``; heading None when not known, x and y NaN."""

    time_ns: int
    parent: str
    child: str
    x: float
    y: float
    heading: float | None

    @property
    def pose(self) -> Pose:
        """The pose; a heading that is not known stands as zero."""
        return Pose(self.x, self.y, self.heading or 0.0)

    @property
    def is_whole(self) -> bool:
        """Whether position and heading are known."""
        return self.heading is not None and math.isfinite(self.x)


class JointSample(NamedTuple):
    """Angles of joints [rad], by name."""

    time_ns: int
    angles: Mapping[str, float]


class RangeSample(NamedTuple):
    """One range [m], by the frame that measured it; ``std_m`` None where the message claims none."""

    time_ns: int
    frame: str
    range_m: float
    std_m: float | None


Sample: TypeAlias = PoseSample | JointSample | RangeSample | Gyro | WifiScan | Ranges
Decoder: TypeAlias = Callable[[bytes], list[Sample]]
"""The samples in one message: one, but for transforms, which come several in a message."""


def pose_sample(time_ns: int, parent: str, child: str, pose: Pose, heading_known: bool) -> PoseSample:
    """A pose; of a position that is not finite neither coordinate is known. Leading slashes of frames (ROS 1) go."""
    x, y, heading = pose if math.isfinite(pose.x) and math.isfinite(pose.y) else (math.nan, math.nan, pose.heading)
    return PoseSample(time_ns, parent.lstrip("/"), child.lstrip("/"), x, y, heading if heading_known else None)


def _pose(data: bytes, *, has_child: bool = False) -> list[Sample]:
    """PoseStamped, PoseWithCovarianceStamped, and Odometry, whose child frame stands between header and pose."""
    cursor = Unpacker(data)
    time_ns, parent = take_header(cursor)
    child = cursor.text() if has_child else ""
    return [pose_sample(time_ns, parent, child, *take_pose(cursor))]


def _transforms(data: bytes) -> list[Sample]:
    cursor = Unpacker(data)
    samples: list[Sample] = []
    for _ in range(cursor.whole()):
        (time_ns, parent), child = take_header(cursor), cursor.text()
        samples.append(pose_sample(time_ns, parent, child, *take_pose(cursor)))
    return samples


def _joints(data: bytes) -> list[Sample]:
    cursor = Unpacker(data)
    time_ns, _ = take_header(cursor)
    names = [cursor.text() for _ in range(cursor.whole())]
    angles = cursor.take("d", cursor.whole())
    if len(names) != len(angles) or not all(map(math.isfinite, angles)):
        raise ValueError(f"{len(names)} joints do not have {len(names)} finite positions")
    return [JointSample(time_ns, dict(zip(names, angles, strict=True)))]


def _range(data: bytes) -> list[Sample]:
    """``variance`` came with ROS 2 Iron, 0 when unknown; NaN and infinite ranges (REP-117) are kept for the host."""
    cursor = Unpacker(data)
    time_ns, frame = take_header(cursor)
    cursor.take("B", 1)
    *_, range_m = cursor.take("f", 4)
    variance = cursor.take("f", 1)[0] if cursor.left >= 4 else 0.0
    return [RangeSample(time_ns, frame.lstrip("/"), range_m, math.sqrt(variance) if variance > 0.0 else None)]


def _own(data: bytes, *, schema: str) -> list[Sample]:
    """A message that our own logs hold too."""
    sample = DECODERS[schema](data, 0)
    if not isinstance(sample, Gyro | WifiScan | Ranges):
        raise TypeError(f"{schema} has no part in a foreign bag")
    return [sample]


ODOMETRY = "nav_msgs/msg/Odometry"
JOINTS = "sensor_msgs/msg/JointState"
IMU = "sensor_msgs/msg/Imu"
RANGE = "sensor_msgs/msg/Range"
RANGES = "fusion_msgs/msg/Ranges"
WIFI = "fusion_msgs/msg/WifiScan"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"

CDR: Mapping[str, Decoder] = {
    ODOMETRY: partial(_pose, has_child=True),
    POSE: _pose,
    POSE_WITH_COVARIANCE: _pose,
    TRANSFORMS: _transforms,
    JOINTS: _joints,
    RANGE: _range,
    **{schema: partial(_own, schema=schema) for schema in (IMU, RANGES, WIFI)},
}
"""Decoders of CDR messages, by type."""
