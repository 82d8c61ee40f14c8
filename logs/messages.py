"""The message types of a log and how our values become them and come back.

Standard ROS 2 types where one exists, a few `fusion_msgs` of our own where none does. The stamp holds the time a
measurement was true, ``frame_id`` the sensor's name, the MCAP sequence number its ``seq``. Numbers are doubles and
come back to the bit, but for headings that pass through a quaternion; the prior's is kept in the log's metadata too,
because a replay starts from it. An all-zero quaternion states that the heading is not known, and so does, of other
people's messages, one that is not finite.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from fusion import (
    Covariance,
    Estimate,
    Fate,
    Gyro,
    LogError,
    Measurement,
    MotorCommand,
    Odometry,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    Truth,
    WheelTicks,
    WifiScan,
)
from fusion.values import NANOSECONDS
from logs.cdr import Packer, Unpacker

MAP = "map"
NOT_GIVEN = -1.0
"""First element of a covariance that is not given (the convention of sensor_msgs/Imu)."""


END_OF_TIME_NS = 2**31 * NANOSECONDS
"""First time that builtin_interfaces/Time cannot hold (in the year 2038, where time counts from 1970)."""


def stamped(time_ns: int, frame_id: str) -> Packer:
    """A message that begins with a std_msgs/Header; raises `LogError` for a time that none can hold."""
    if not 0 <= time_ns < END_OF_TIME_NS:
        raise LogError(f"{frame_id} at {time_ns} ns: a log holds times from 0 to 2^31 s; shift the run's clock")
    sec, nanosec = divmod(time_ns, NANOSECONDS)
    return Packer().put("i", sec).put("I", nanosec).text(frame_id)


def take_header(cursor: Unpacker) -> tuple[int, str]:
    """Time [ns] and frame of a std_msgs/Header."""
    sec, nanosec = cursor.fields("iI")
    return sec * NANOSECONDS + nanosec, cursor.text()


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _put_pose(message: Packer, pose: Pose, *, heading_known: bool = True) -> Packer:
    if not heading_known:
        return message.put("d", pose.x, pose.y, *[0.0] * 5)
    half = 0.5 * pose.heading
    return message.put("d", pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))


def take_pose(cursor: Unpacker) -> tuple[Pose, bool]:
    """A geometry_msgs/Pose (or Transform) on the floor, and whether its heading is known."""
    x, y, _, *xyzw = cursor.take("d", 7)
    return planar(x, y, *xyzw)


def planar(x: float, y: float, qx: float, qy: float, qz: float, qw: float) -> tuple[Pose, bool]:
    """A pose in space brought to the floor, and whether its heading is known: the yaw of a unit quaternion. Not of one
    that is no rotation, all zero or not finite: the heading is zero then, and not known.
    """
    if not any((qx, qy, qz, qw)) or not all(map(math.isfinite, (qx, qy, qz, qw))):
        return Pose(x, y, 0.0), False
    return Pose(x, y, math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))), True


def _put_covariance(message: Packer, covariance: Covariance | None) -> Packer:
    """(x, y, heading) within the 6x6 of (x, y, z, roll, pitch, yaw)."""
    cells = [0.0] * 36
    if covariance is None:
        cells[0] = NOT_GIVEN
    else:
        matrix = covariance.matrix
        for row, big_row in enumerate((0, 1, 5)):
            for column, big_column in enumerate((0, 1, 5)):
                cells[6 * big_row + big_column] = matrix[row][column]
    return message.put("d", *cells)


def _take_covariance(cursor: Unpacker) -> Covariance | None:
    c = cursor.take("d", 36)
    if c[0] == NOT_GIVEN:
        return None
    return Covariance.from_matrix([[c[6 * row + column] for column in (0, 1, 5)] for row in (0, 1, 5)])


def _encode_ticks(value: WheelTicks) -> bytes:
    return stamped(value.time_ns, value.sensor).put("I", len(value.counts)).put("q", *value.counts).message()


def _decode_ticks(data: bytes, seq: int) -> WheelTicks:
    cursor = Unpacker(data)
    time_ns, sensor = take_header(cursor)
    counts = cursor.take("q", cursor.whole())
    return WheelTicks(time_ns, sensor, seq, tuple(int(count) for count in counts))


def _encode_command(value: MotorCommand) -> bytes:
    speeds = value.wheel_speeds_m_s
    return stamped(value.time_ns, value.sensor).put("I", len(speeds)).put("d", *speeds).message()


def _decode_command(data: bytes, seq: int) -> MotorCommand:
    cursor = Unpacker(data)
    time_ns, sensor = take_header(cursor)
    return MotorCommand(time_ns, sensor, seq, cursor.take("d", cursor.whole()))


def _encode_odometry(value: Odometry) -> bytes:
    message = stamped(value.time_ns, value.sensor).put("q", value.from_ns)
    return message.put("d", value.distance_m, value.turn_rad).put("?", value.measured).message()


def _decode_odometry(data: bytes, seq: int) -> Odometry:
    cursor = Unpacker(data)
    time_ns, sensor = take_header(cursor)
    return Odometry(time_ns, sensor, seq, *cursor.fields("qdd?"))


def _encode_gyro(value: Gyro) -> bytes:
    no_orientation = (0.0, 0.0, 0.0, 1.0, NOT_GIVEN, *[0.0] * 8)
    known = value.acceleration_m_s2
    acceleration = (0.0, 0.0, 0.0, NOT_GIVEN, *[0.0] * 8) if known is None else (*known, *[0.0] * 9)
    message = stamped(value.time_ns, value.sensor).put("d", *no_orientation)
    return message.put("d", 0.0, 0.0, value.rate_rad_s, *[0.0] * 9, *acceleration).message()


def _decode_gyro(data: bytes, seq: int) -> Gyro:
    cursor = Unpacker(data)
    time_ns, sensor = take_header(cursor)
    *_, rate_rad_s, first_covariance = cursor.take("d", 17)
    if first_covariance == NOT_GIVEN:
        raise ValueError("the message states that it measures no turn rate")
    cursor.take("d", 8)
    x, y, z, first_covariance = cursor.take("d", 4)
    return Gyro(time_ns, sensor, seq, rate_rad_s, None if first_covariance == NOT_GIVEN else (x, y, z))


def _encode_scan(value: WifiScan) -> bytes:
    message = stamped(value.time_ns, value.sensor).put("I", len(value.readings))
    for reading in value.readings:
        message.text(reading.anchor).put("d", reading.rssi_dbm).put("q", reading.age_ns)
    return message.message()


def _decode_scan(data: bytes, seq: int) -> WifiScan:
    cursor = Unpacker(data)
    time_ns, sensor = take_header(cursor)
    readings = (RssiReading(cursor.text(), cursor.take("d", 1)[0], cursor.whole("q")) for _ in range(cursor.whole()))
    return WifiScan(time_ns, sensor, seq, tuple(readings))


def _encode_ranges(value: Ranges) -> bytes:
    message = stamped(value.time_ns, value.sensor).put("I", len(value.readings))
    for reading in value.readings:
        message.text(reading.anchor).put("d", reading.range_m, _number(reading.std_m))
    return message.message()


def _decode_ranges(data: bytes, seq: int) -> Ranges:
    cursor = Unpacker(data)
    time_ns, sensor = take_header(cursor)
    readings = []
    for _ in range(cursor.whole()):
        anchor, (range_m, std_m) = cursor.text(), cursor.take("d", 2)
        readings.append(RangeReading(anchor, range_m, None if math.isnan(std_m) else std_m))
    return Ranges(time_ns, sensor, seq, tuple(readings))


class Codec(NamedTuple):
    """Topic, message type, encoder and decoder of one type of measurement."""

    topic: str
    schema: str
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes, int], Measurement]


CODECS: dict[type, Codec] = {
    WheelTicks: Codec("/wheel/ticks", "fusion_msgs/msg/WheelTicks", _encode_ticks, _decode_ticks),
    MotorCommand: Codec("/wheel/command", "fusion_msgs/msg/MotorCommand", _encode_command, _decode_command),
    Odometry: Codec("/wheel/odometry", "fusion_msgs/msg/OdometryIncrement", _encode_odometry, _decode_odometry),
    Gyro: Codec("/imu/raw", "sensor_msgs/msg/Imu", _encode_gyro, _decode_gyro),
    WifiScan: Codec("/wifi/scan", "fusion_msgs/msg/WifiScan", _encode_scan, _decode_scan),
    Ranges: Codec("/ranges", "fusion_msgs/msg/Ranges", _encode_ranges, _decode_ranges),
}
TRUTH = ("/ground_truth", "geometry_msgs/msg/PoseStamped")
DECODERS = {codec.schema: codec.decode for codec in CODECS.values()}
"""Decoders by message type, whatever the topic."""
PRIOR = ("/initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped")
ESTIMATE_TOPIC = "/estimate/"
FATES_TOPIC = "/fates/"


def encode_truth(truth: Truth) -> bytes:
    """Ground truth."""
    heading = truth.known_heading
    pose, known = Pose(truth.x, truth.y, heading or 0.0), heading is not None
    return _put_pose(stamped(truth.time_ns, MAP), pose, heading_known=known).message()


def decode_truth(data: bytes) -> Truth:
    """Ground truth from its message."""
    cursor = Unpacker(data)
    time_ns, _ = take_header(cursor)
    pose, has_heading = take_pose(cursor)
    return Truth(time_ns, pose.x, pose.y, pose.heading if has_heading else None)


def encode_prior(prior: Prior) -> tuple[bytes, dict[str, str]]:
    """The starting pose, and what goes into the log's metadata: what of it is known, and the heading to the bit."""
    message = _put_pose(stamped(prior.time_ns, MAP), prior.pose, heading_known=prior.heading_known)
    about = {
        "position_known": str(prior.position_known).lower(),
        "heading_known": str(prior.heading_known).lower(),
        "heading_rad": repr(float(prior.pose.heading)),
    }
    return _put_covariance(message, prior.covariance).message(), about


def decode_prior(data: bytes, about: Mapping[str, str]) -> Prior:
    """The starting pose from its message and the log's metadata, which wins where it holds more."""
    cursor = Unpacker(data)
    time_ns, _ = take_header(cursor)
    pose, has_heading = take_pose(cursor)
    covariance = _take_covariance(cursor)
    if covariance is None:
        raise ValueError("the prior states no covariance")
    heading = float(about.get("heading_rad", pose.heading))
    known = [about.get(key, "true") == "true" for key in ("position_known", "heading_known")]
    return Prior(time_ns, pose._replace(heading=heading), covariance, known[0], known[1] and has_heading)


def encode_estimate(estimate: Estimate) -> bytes:
    """An estimate; one without a covariance states so in its first element."""
    message = _put_pose(stamped(estimate.time_ns, MAP), estimate.pose, heading_known=estimate.heading_known)
    return _put_covariance(message, estimate.covariance).message()


def decode_estimate(data: bytes) -> Estimate:
    """An estimate from its message."""
    cursor = Unpacker(data)
    time_ns, _ = take_header(cursor)
    pose, has_heading = take_pose(cursor)
    return Estimate(time_ns, pose, _take_covariance(cursor), heading_known=has_heading)


def encode_fates(time_ns: int, sensor: str, fates: tuple[Fate, ...]) -> bytes:
    """The fates of the readings of one measurement."""
    message = stamped(time_ns, sensor).put("I", len(fates))
    for fate in fates:
        message.text(fate.anchor).text(fate.decision.value).text(fate.reason.value)
        numbers = (fate.innovation, fate.innovation_variance, fate.nis)
        message.put("d", fate.weight, *map(_number, numbers))
    return message.message()
