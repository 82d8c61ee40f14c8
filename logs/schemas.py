"""Definitions of the message types of a log: standard ROS 2 types, and `fusion_msgs` where none exists."""

from __future__ import annotations

SEPARATOR = "=" * 80 + "\n"
TIME = SEPARATOR + "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
STAMPED = SEPARATOR + "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + TIME
VECTOR = SEPARATOR + "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = SEPARATOR + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
POINT = SEPARATOR + "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
POSE = SEPARATOR + "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n" + POINT + QUATERNION

SCHEMAS = {
    "fusion_msgs/msg/WheelTicks": "# cumulative encoder counts, in the wheel order of the world\n"
    "std_msgs/Header header\nint64[] counts\n" + STAMPED,
    "fusion_msgs/msg/MotorCommand": "# signed wheel speeds [m/s]\n"
    "std_msgs/Header header\nfloat64[] wheel_speeds_m_s\n" + STAMPED,
    "fusion_msgs/msg/OdometryIncrement": "# motion over (from_ns, stamp]\nstd_msgs/Header header\n"
    "int64 from_ns\nfloat64 distance_m\nfloat64 turn_rad\nbool measured\n" + STAMPED,
    "fusion_msgs/msg/WifiScan": "std_msgs/Header header\nRssiReading[] readings\n" + STAMPED + SEPARATOR
    + "MSG: fusion_msgs/RssiReading\nstring anchor\nfloat64 rssi_dbm\nint64 age_ns\n",
    "fusion_msgs/msg/Ranges": "# std_m NaN: the device claims none\n"
    "std_msgs/Header header\nRangeReading[] readings\n" + STAMPED + SEPARATOR
    + "MSG: fusion_msgs/RangeReading\nstring anchor\nfloat64 range_m\nfloat64 std_m\n",
    "fusion_msgs/msg/Fates": "# what became of each reading of one measurement; NaN: no such number\n"
    "std_msgs/Header header\nFate[] fates\n" + STAMPED + SEPARATOR
    + "MSG: fusion_msgs/Fate\nstring anchor\nstring decision\nstring reason\nfloat64 weight\nfloat64 innovation\n"
    "float64 innovation_variance\nfloat64 nis\n",
    "fusion_msgs/msg/ClockSync": "# the clocks of one computer at one moment; all stamps are boot_ns\n"
    "std_msgs/Header header\nint64 boot_ns\nint64 monotonic_ns\nint64 real_ns\nbool ntp_synced\n" + STAMPED,
    "diagnostic_msgs/msg/DiagnosticArray": "std_msgs/Header header\nDiagnosticStatus[] status\n" + STAMPED + SEPARATOR
    + "MSG: diagnostic_msgs/DiagnosticStatus\nbyte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\n"
    "string name\nstring message\nstring hardware_id\nKeyValue[] values\n" + SEPARATOR
    + "MSG: diagnostic_msgs/KeyValue\nstring key\nstring value\n",
    "sensor_msgs/msg/Imu": "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
    "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
    "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
    "float64[9] linear_acceleration_covariance\n" + STAMPED + QUATERNION + VECTOR,
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\nPose pose\n" + STAMPED + POSE,
    "geometry_msgs/msg/PoseWithCovarianceStamped": "std_msgs/Header header\nPoseWithCovariance pose\n" + STAMPED
    + SEPARATOR + "MSG: geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n" + POSE,
}  # fmt: skip
"""Definition texts by type name, as the MCAP schema encoding `ros2msg` wants them."""
