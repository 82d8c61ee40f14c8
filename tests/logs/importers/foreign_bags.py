"""Bags of other people's making, written by an independent ROS 2 library."""

import math
from types import SimpleNamespace

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore

from logs.schemas import SCHEMAS

SECOND = 1_000_000_000
OWN = ("fusion_msgs/msg/WifiScan", "fusion_msgs/msg/Ranges")


class Ros:
    """Builds messages of one ROS 2 release and writes them into a bag; everything is (topic, log time, message)."""

    def __init__(self, release):
        self.store = get_typestore(release)
        for name in OWN:
            types = get_types_from_msg(SCHEMAS[name], name)
            self.store.register({key: fields for key, fields in types.items() if key.startswith("fusion_msgs/")})

    def make(self, name, *fields, **more):
        return self.store.types[name](*fields, **more)

    def header(self, time_ns, frame=""):
        stamp = self.make("builtin_interfaces/msg/Time", *divmod(time_ns, SECOND))
        return self.make("std_msgs/msg/Header", stamp, frame)

    def vector(self, x, y, z=0.0):
        return self.make("geometry_msgs/msg/Vector3", x, y, z)

    def quaternion(self, heading):
        """Of a heading [rad]: None is all zeros, NaN all NaN."""
        half = 0.0 if heading is None else 0.5 * heading
        zw = (0.0, 0.0) if heading is None else (math.sin(half), math.cos(half))
        return self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, *zw)

    def plain_pose(self, x, y, heading):
        point = self.make("geometry_msgs/msg/Point", x, y, 7.0)
        return self.make("geometry_msgs/msg/Pose", point, self.quaternion(heading))

    def uncertain_pose(self, x, y, heading):
        return self.make("geometry_msgs/msg/PoseWithCovariance", self.plain_pose(x, y, heading), np.ones(36))

    def pose(self, time_ns, x, y, heading=None):
        return self.make("geometry_msgs/msg/PoseStamped", self.header(time_ns, "mocap"), self.plain_pose(x, y, heading))

    def pose_with_covariance(self, time_ns, x, y, heading=None):
        return self.make(
            "geometry_msgs/msg/PoseWithCovarianceStamped", self.header(time_ns), self.uncertain_pose(x, y, heading)
        )

    def odometry(self, time_ns, x, y, heading):
        twist = self.make("geometry_msgs/msg/Twist", self.vector(9.0, 9.0), self.vector(0.0, 0.0, 9.0))
        twist = self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.ones(36))
        pose = self.uncertain_pose(x, y, heading)
        return self.make("nav_msgs/msg/Odometry", self.header(time_ns, "odom"), "base_link", pose, twist)

    def transforms(self, *rows):
        """Rows are (time, parent, child, x, y, heading)."""
        stamped = [
            self.make(
                "geometry_msgs/msg/TransformStamped",
                self.header(time_ns, parent),
                child,
                self.make("geometry_msgs/msg/Transform", self.vector(x, y, 7.0), self.quaternion(heading)),
            )
            for time_ns, parent, child, x, y, heading in rows
        ]
        return self.make("tf2_msgs/msg/TFMessage", stamped)

    def joints(self, time_ns, **angles):
        numbers = np.array(list(angles.values()), dtype=np.float64)
        return self.make("sensor_msgs/msg/JointState", self.header(time_ns), list(angles), numbers, numbers, numbers)

    def imu(self, time_ns, rate, frame="imu_link", *, measured=True):
        nine = np.zeros(9)
        about_rate = nine if measured else np.array([-1.0, *[0.0] * 8])
        gravity = self.vector(0.0, 0.0, 9.81)
        turn = self.vector(0.1, 0.2, rate)
        return self.make(
            "sensor_msgs/msg/Imu",
            self.header(time_ns, frame),
            self.quaternion(0.3),
            nine,
            turn,
            about_rate,
            gravity,
            nine,
        )

    def range(self, time_ns, frame, range_m, **more):
        return self.make("sensor_msgs/msg/Range", self.header(time_ns, frame), 1, 0.1, 0.0, 100.0, range_m, **more)

    def ranges(self, time_ns, **ranges):
        readings = [self.make("fusion_msgs/msg/RangeReading", name, far, math.nan) for name, far in ranges.items()]
        return self.make("fusion_msgs/msg/Ranges", self.header(time_ns, "uwb"), readings)

    def scan(self, time_ns, **rssi_dbm):
        readings = [self.make("fusion_msgs/msg/RssiReading", name, value, 5) for name, value in rssi_dbm.items()]
        return self.make("fusion_msgs/msg/WifiScan", self.header(time_ns, "wlan0"), readings)

    def bag(self, folder, rows):
        """Write the rows into the bag ``folder``; a message given as bytes is written as it stands, as a String."""
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = {}
            for topic, log_ns, message in rows:
                name, data = self._packed(message)
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, name, typestore=self.store)
                writer.write(connections[topic], log_ns, data)
        return folder

    def _packed(self, message):
        if isinstance(message, SimpleNamespace):  # damaged on purpose: a type, and bytes that are none of it
            return message.type, message.data
        return message.__msgtype__, self.store.serialize_cdr(message, message.__msgtype__)
