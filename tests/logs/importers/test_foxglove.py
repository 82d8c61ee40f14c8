"""Foxglove's poses, in JSON and in protobuf, are truth as good as a ROS message."""

import builtins
import json
import math

import numpy as np
import pytest
from mcap.writer import Writer

from fusion import Gyro
from fusion.errors import ParameterError
from logs.importers.rosbag import read_bag
from logs.messages import CODECS
from logs.schemas import SCHEMAS
from tests.worlds import empty_world

SECOND = 1_000_000_000
T = 1_652_380_260_171_842_098
WORLD = empty_world()
HEADING = 0.5
XYZW = dict(zip("xyzw", (0.0, 0.0, math.sin(0.25), math.cos(0.25)), strict=True))
PLACE = {"x": 1.1, "y": 2.2, "z": 3.3}
TOPIC_OF = {
    "foxglove.PoseInFrame": "/pose",
    "foxglove.FrameTransform": "tf:map>base_link",
    "foxglove.FrameTransforms": "tf:map>base_link",
}


def fields(kind, time_ns, seconds, nanos, *, turned=True):
    """The fields of a message, as JSON has them; ``seconds`` and ``nanos`` are the names of a time's parts."""
    stamp = dict(zip((seconds, nanos), divmod(time_ns, SECOND), strict=True))
    rotation = XYZW if turned else None
    if kind == "foxglove.PoseInFrame":
        pose = {"position": PLACE, **({"orientation": rotation} if rotation else {})}
        return {"timestamp": stamp, "frame_id": "map", "pose": pose}
    transform = {"parent_frame_id": "map", "child_frame_id": "base_link", "translation": PLACE}
    transform = {"timestamp": stamp, **transform, **({"rotation": rotation} if rotation else {})}
    return transform if kind == "foxglove.FrameTransform" else {"transforms": [transform]}


def definitions():
    """Foxglove's definitions of the three types as a FileDescriptorSet, the files in no helpful order."""
    from google.protobuf import timestamp_pb2
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet

    numbers, text, message = (getattr(FieldDescriptorProto, f"TYPE_{name}") for name in ("DOUBLE", "STRING", "MESSAGE"))
    types = {
        "Vector3": [("x", numbers), ("y", numbers), ("z", numbers)],
        "Quaternion": [("x", numbers), ("y", numbers), ("z", numbers), ("w", numbers)],
        "Pose": [("position", ".foxglove.Vector3"), ("orientation", ".foxglove.Quaternion")],
        "PoseInFrame": [("timestamp", ".google.protobuf.Timestamp"), ("frame_id", text), ("pose", ".foxglove.Pose")],
        "FrameTransform": [
            ("timestamp", ".google.protobuf.Timestamp"),
            ("parent_frame_id", text),
            ("child_frame_id", text),
            ("translation", ".foxglove.Vector3"),
            ("rotation", ".foxglove.Quaternion"),
        ],
        "FrameTransforms": [("transforms", ".foxglove.FrameTransform")],
    }
    file = FileDescriptorProto(name="foxglove.proto", package="foxglove", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    for name, rows in types.items():
        described = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(rows, 1):
            many = FieldDescriptorProto.LABEL_REPEATED if field == "transforms" else FieldDescriptorProto.LABEL_OPTIONAL
            nested = isinstance(kind, str)
            described.field.add(
                name=field,
                number=number,
                label=many,
                type=message if nested else kind,
                type_name=kind if nested else None,
            )
    stamp = FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    return FileDescriptorSet(file=[file, stamp])


def protobuf(kind, values):
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.json_format import ParseDict
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    for file in reversed(definitions().file):
        pool.Add(file)
    message = GetMessageClass(pool.FindMessageTypeByName(kind))()
    stamped = values["transforms"][0] if "transforms" in values else values
    stamp = stamped.pop("timestamp")
    ParseDict(values, message)
    inner = message.transforms[0] if "transforms" in values else message
    inner.timestamp.seconds, inner.timestamp.nanos = stamp["seconds"], stamp["nanos"]
    return message.SerializeToString()


def written(path, encoding, kind, *messages):
    """A bag of these messages of one type, a gyro message of a robot running ROS 2 after each."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="motion capture")
        gyro = CODECS[Gyro]
        imu = writer.register_schema(gyro.schema, "ros2msg", SCHEMAS[gyro.schema].encode())
        turning = writer.register_channel("/imu", "cdr", imu)
        definition = definitions().SerializeToString() if encoding == "protobuf" else b"{}"
        schema = writer.register_schema(kind, {"json": "jsonschema"}.get(encoding, encoding), definition)
        channel = writer.register_channel("/pose", encoding, schema)
        for i, data in enumerate(messages):
            writer.add_message(channel, T + i, data, T + i)
            writer.add_message(turning, T + i, gyro.encode(Gyro(T + i, "g", i, 0.5)), T + i)
            writer.flush()
        writer.finish()
    return path


def json_message(kind, time_ns, **options):
    return json.dumps(fields(kind, time_ns, "sec", "nsec", **options)).encode()


def protobuf_message(kind, time_ns, **options):
    return protobuf(kind, fields(kind, time_ns, "seconds", "nanos", **options))


PACKED = {"json": json_message, "protobuf": protobuf_message}


@pytest.mark.parametrize("encoding", PACKED)
@pytest.mark.parametrize("kind", TOPIC_OF)
def test_truth_keeps_every_digit_and_a_missing_rotation_is_no_heading(tmp_path, encoding, kind):
    messages = [PACKED[encoding](kind, T), PACKED[encoding](kind, T + 1, turned=False)]
    run = read_bag(written(tmp_path / "run.mcap", encoding, kind, *messages), WORLD, {"truth": TOPIC_OF[kind]})
    assert run.truth.time_ns.tolist() == [T, T + 1]
    assert (run.truth.x.tolist(), run.truth.y.tolist()) == ([1.1, 1.1], [2.2, 2.2])
    assert run.truth.heading[0] == pytest.approx(HEADING, abs=1e-15)
    assert math.isnan(run.truth.heading[1])
    assert run.measurements == (Gyro(T, "/imu", 0, 0.5), Gyro(T + 1, "/imu", 1, 0.5))
    assert run.warnings == ()


@pytest.mark.parametrize(
    ("encoding", "damaged"),
    [
        ("json", b"not json"),
        ("json", b'{"frame_id": "map"}'),
        ("json", b'{"timestamp": {"sec": 1, "nsec": 0}, "frame_id": "", "pose": {"position": {"x": null, "y": 0}}}'),
        ("protobuf", b"\xff\xff"),
    ],
)
def test_message_without_content_is_counted(tmp_path, encoding, damaged):
    kind = "foxglove.PoseInFrame"
    path = written(tmp_path / "run.mcap", encoding, kind, damaged, PACKED[encoding](kind, T))
    run = read_bag(path, WORLD, {"truth": "/pose"})
    assert run.truth.time_ns.tolist() == [T]
    assert "1 messages of /pose cannot be decoded" in run.warnings[0]


def test_pose_without_a_position_is_counted_and_one_without_a_rotation_has_no_heading(tmp_path):
    kind = "foxglove.PoseInFrame"
    rotation = {"x": math.nan, "y": 0.0, "z": 0.0, "w": 1.0}
    odd = [
        {
            "timestamp": {"sec": 1, "nsec": i},
            "frame_id": "",
            "pose": {"position": {"x": x, "y": 0}, "orientation": rotation},
        }
        for i, x in enumerate((math.nan, 2.0))
    ]
    packed = [*(json.dumps(message).encode() for message in odd), json_message(kind, T)]
    run = read_bag(written(tmp_path / "run.mcap", "json", kind, *packed), WORLD, {"truth": "/pose"})
    assert run.truth.x.tolist() == [2.0, 1.1]
    assert np.isnan(run.truth.heading).tolist() == [True, False]
    assert "1 of 3 true poses have no position" in run.warnings[0]


def test_pose_packed_in_another_way_is_refused(tmp_path):
    path = written(tmp_path / "run.mcap", "flatbuffer", "foxglove.PoseInFrame", b"")
    with pytest.raises(ParameterError, match="/pose is packed as 'flatbuffer', which is not read here"):
        read_bag(path, WORLD, {"truth": "/pose"})


def test_bag_cut_in_half_keeps_what_stands_before(tmp_path):
    kind = "foxglove.PoseInFrame"
    path = written(tmp_path / "run.mcap", "json", kind, *(json_message(kind, T + i) for i in range(20)))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    run = read_bag(path, WORLD, {"truth": "/pose"})
    count = len(run.truth)
    assert 0 < count < 20
    assert run.truth.time_ns.tolist() == [T + i for i in range(count)]
    assert "cut off: " in run.warnings[0]


def test_without_the_protobuf_package_only_the_topic_that_needs_it_is_lost(tmp_path, monkeypatch):
    kind = "foxglove.PoseInFrame"
    path = written(tmp_path / "run.mcap", "protobuf", kind, protobuf_message(kind, T))
    real = builtins.__import__

    def without(name, *arguments, **more):
        if name.startswith("google"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *arguments, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    assert read_bag(path, WORLD).measurements == (Gyro(T, "/imu", 0, 0.5),)
    with pytest.raises(ParameterError, match=r"pip install 'fusion-localization\[foxglove\]'"):
        read_bag(path, WORLD, {"truth": "/pose"})
