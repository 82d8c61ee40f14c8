"""CDR: our bytes are those of an independent ROS 2 library, and a message that is cut off is never half believed."""

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fusion import (
    Covariance,
    Estimate,
    Gyro,
    MotorCommand,
    Odometry,
    Pose,
    RangeReading,
    Ranges,
    RssiReading,
    WheelTicks,
    WifiScan,
)
from logs.cdr import Packer, Unpacker
from logs.messages import CODECS, encode_estimate
from logs.schemas import SCHEMAS

T = 1_652_380_260_171_842_098
VALUES = (
    WheelTicks(T, "enc", 1, (1, -2, 2**62, 4)),
    WheelTicks(T, "enc", 1, ()),
    MotorCommand(T, "motors", 2, (0.1, -0.2)),
    Odometry(T, "odo", 3, T - 7, 0.1 + 0.2, -1e-17, measured=False),
    Gyro(T, "g", 4, 0.123456789012345678),
    WifiScan(T, "wifi", 5, (RssiReading("ä", -51.25, 7), RssiReading("bcd", math.inf))),
    Ranges(T, "uwb", 6, (RangeReading("b", 1 / 3), RangeReading("ab", 2.0, 0.1))),
    Ranges(T, "uwb", 6, ()),
)


@pytest.fixture(scope="module")
def ros():
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in SCHEMAS.items():
        if name.startswith("fusion_msgs/"):
            types = get_types_from_msg(text, name)
            store.register({key: fields for key, fields in types.items() if key.startswith("fusion_msgs/")})
    return store


@pytest.mark.parametrize("value", VALUES, ids=lambda value: type(value).__name__)
def test_bytes_are_those_another_library_writes_for_the_same_message(ros, value):
    codec = CODECS[type(value)]
    data = codec.encode(value)
    message = ros.deserialize_cdr(data, codec.schema)
    assert message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec == T
    assert message.header.frame_id == value.sensor
    assert bytes(ros.serialize_cdr(message, codec.schema)) == data


def test_estimate_is_the_standard_pose_with_covariance(ros):
    covariance = Covariance(1.0, 0.1, 0.2, 2.0, 0.3, 3.0)
    data = encode_estimate(Estimate(T, Pose(1.0, 2.0, math.pi / 2), covariance))
    pose = ros.deserialize_cdr(data, "geometry_msgs/msg/PoseWithCovarianceStamped").pose
    assert (pose.pose.position.x, pose.pose.position.y) == (1.0, 2.0)
    assert pose.pose.orientation.z == pytest.approx(math.sqrt(0.5))
    six = pose.covariance.reshape(6, 6)
    assert six[[0, 1, 5]][:, [0, 1, 5]].tolist() == [list(row) for row in covariance.matrix]
    assert six[2:5].any() == six[:, 2:5].any() == False  # noqa: E712 - numpy's own False


FIELDS = st.one_of(
    st.tuples(st.just("d"), st.floats()),
    st.tuples(st.just("q"), st.integers(-(2**63), 2**63 - 1)),
    st.tuples(st.just("I"), st.integers(0, 2**32 - 1)),
    st.tuples(st.just("?"), st.booleans()),
    st.tuples(st.just("text"), st.text(st.characters(exclude_categories=["Cs"]))),
)


def test_fields_of_any_kind_in_any_order_come_back_to_the_bit():
    @settings(derandomize=True, max_examples=200)
    @given(st.lists(FIELDS, max_size=12))
    def check(fields):
        packer = Packer()
        for code, value in fields:
            packer.text(value) if code == "text" else packer.put(code, value)
        unpacker = Unpacker(packer.message())
        for code, value in fields:
            back = unpacker.text() if code == "text" else unpacker.take(code, 1)[0]
            same = struct.pack("<d", back) == struct.pack("<d", value) if code == "d" else back == value
            assert same

    check()


@pytest.mark.parametrize("value", VALUES, ids=lambda value: type(value).__name__)
def test_message_cut_off_at_any_byte_is_refused(value):
    codec = CODECS[type(value)]
    data = codec.encode(value)
    assert codec.decode(data, value.seq) == value
    for length in range(len(data)):
        if codec.schema.startswith("sensor_msgs/") and length >= len(data) - 20 * 8:
            break  # the gyro's rate and its covariance stand before 20 doubles that mean nothing
        with pytest.raises((struct.error, ValueError)):
            codec.decode(data[:length], value.seq)


def test_big_endian_message_is_refused():
    with pytest.raises(ValueError, match="not little-endian"):
        Unpacker(b"\x00\x00\x00\x00abcd")
