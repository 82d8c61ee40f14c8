"""Poses and transforms as Foxglove defines them, in JSON or protobuf: motion capture often comes this way.

Protobuf messages are read by the definition in the file itself, so nothing is generated or guessed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from fusion.values import NANOSECONDS
from logs.importers.samples import Decoder, PoseSample, Sample, pose_sample
from logs.messages import planar

POSE_IN_FRAME = "foxglove.PoseInFrame"
TRANSFORM = "foxglove.FrameTransform"
TRANSFORMS = "foxglove.FrameTransforms"

Fields = Any
"""A message as an object with an attribute per field, whatever it was packed in."""


def _pose(message: Fields) -> list[Sample]:
    return [_sample(message, message.frame_id, "", message.pose.position, getattr(message.pose, "orientation", None))]


def _transform(message: Fields) -> list[Sample]:
    frames = message.parent_frame_id, message.child_frame_id
    return [_sample(message, *frames, message.translation, getattr(message, "rotation", None))]


def _transforms(message: Fields) -> list[Sample]:
    return [sample for transform in message.transforms for sample in _transform(transform)]


READERS: Mapping[str, Callable[[Fields], list[Sample]]] = {
    POSE_IN_FRAME: _pose,
    TRANSFORM: _transform,
    TRANSFORMS: _transforms,
}
"""Readers of the fields, by message type."""


def _sample(message: Fields, parent: str, child: str, place: Fields, rotation: Fields) -> PoseSample:
    """One pose; without a rotation its heading is not known."""
    xyzw = [0.0] * 4 if rotation is None else [float(getattr(rotation, axis)) for axis in "xyzw"]
    return pose_sample(_time_ns(message.timestamp), parent, child, *planar(float(place.x), float(place.y), *xyzw))


def _time_ns(stamp: Fields) -> int:
    """JSON has ``sec`` and ``nsec``, protobuf ``seconds`` and ``nanos``."""
    second, part = ("sec", "nsec") if isinstance(stamp, SimpleNamespace) else ("seconds", "nanos")
    return int(getattr(stamp, second)) * NANOSECONDS + int(getattr(stamp, part))


def json_decoder(kind: str) -> Decoder:
    """A decoder of JSON messages of the type ``kind``."""
    read = READERS[kind]
    return lambda data: read(json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields)))


def protobuf_decoder(kind: str, definition: bytes) -> Decoder:
    """A decoder of protobuf messages by a serialized FileDescriptorSet; raises `ModuleNotFoundError` without the
    `protobuf` package.
    """
    from google.protobuf.descriptor_database import DescriptorDatabase
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    database = DescriptorDatabase()
    for file in FileDescriptorSet.FromString(definition).file:
        database.Add(file)
    # A pool over a database looks definitions up when they are needed, in whatever order the file lists them.
    message = GetMessageClass(DescriptorPool(database).FindMessageTypeByName(kind))
    read = READERS[kind]
    return lambda data: read(message.FromString(data))
