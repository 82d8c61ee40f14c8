"""A bag of somebody else's robot becomes a run: every role, every type, and what is refused."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
import tomlkit

from fusion import Gyro, Increment, LogError, Odometry, RangeReading, Ranges, RssiReading, WifiScan, World
from fusion.cli.main import main
from fusion.errors import ParameterError
from logs.cli.import_ import import_recordings
from logs.importers.rosbag import read_bag
from logs.reader import read_run

SECOND = 1_000_000_000
TABLE = {
    "name": "hall",
    "anchors": [{"id": name, "position_m": place} for name, place in (("a", [0, 0]), ("b", [5, 0]), ("c", [0, 5]))],
    "robot": {"drive": "differential", "wheel_circumference_m": math.tau * 0.1, "track_width_m": 0.5},
}
WORLD = World.from_table(TABLE)
POSES = ((1, 0.0, 0.0, 0.0), (2, 1.0, 0.0, 0.0), (3, 1.5, 0.5, math.pi / 2), (4, 1.5, 1.5, math.pi / 2))
"""Time [s] and pose of the robot's own odometry: straight on, a quarter circle, straight on."""
CHORD_M = math.sqrt(0.5)

GRAVITY = (0.0, 0.0, 9.81)
"""What the IMU of the test bags feels."""


@pytest.fixture
def drive(ros):
    """Rows of a drive with every role played once, each message 1 ms late."""
    rows = [("/odom", ros.odometry(t * SECOND, x, y, heading), t) for t, x, y, heading in POSES]
    rows += [("/imu/data", ros.imu(t * SECOND, 0.1 * t), t) for t in range(1, 5)]
    rows += [("/uwb/a", ros.range(2 * SECOND, "a", 2.5), 2), ("/uwb/b", ros.range(2 * SECOND, "b", 4.5), 2)]
    rows += [("/wifi", ros.scan(3 * SECOND, a=-40.5, b=-60.0), 3)]
    rows += [("/mocap", ros.pose(t * SECOND, x, y, heading), t) for t, x, y, heading in POSES]
    return [(topic, t * SECOND + 1_000_000, message) for topic, message, t in rows]


def of(run, kind):
    return [measurement for measurement in run.measurements if isinstance(measurement, kind)]


def test_every_role_is_read_with_its_exact_numbers(tmp_path, ros, drive):
    run = read_bag(ros.bag(tmp_path / "walk", drive), WORLD, {"truth": "/mocap"})
    assert (run.name, run.world, run.warnings, dict(run.lanes)) == ("walk", WORLD, (), {})
    assert of(run, Gyro) == [Gyro(t * SECOND, "/imu/data", t - 1, 0.1 * t, GRAVITY) for t in range(1, 5)]
    assert of(run, Ranges) == [
        Ranges(2 * SECOND, "/uwb/a", 0, (RangeReading("a", 2.5),)),
        Ranges(2 * SECOND, "/uwb/b", 0, (RangeReading("b", 4.5),)),
    ]
    readings = (RssiReading("a", -40.5, 5), RssiReading("b", -60.0, 5))
    assert of(run, WifiScan) == [WifiScan(3 * SECOND, "/wifi", 0, readings)]
    assert run.truth.time_ns.tolist() == [t * SECOND for t, *_ in POSES]
    assert np.column_stack([run.truth.x, run.truth.y]).tolist() == [[x, y] for _, x, y, _ in POSES]
    assert run.truth.heading.tolist() == pytest.approx([heading for *_, heading in POSES], abs=1e-15)
    assert run.prior.pose == (0.0, 0.0, 0.0)
    assert run.metadata["topics"] == "truth=/mocap odom=/odom gyro=/imu/data wifi=/wifi range=/uwb/a range=/uwb/b"


def test_odometry_is_the_way_along_the_middle_of_each_turn(tmp_path, ros, drive):
    odometry = of(read_bag(ros.bag(tmp_path / "bag", drive), WORLD), Odometry)
    spans = [((step.from_ns // SECOND, step.time_ns // SECOND), step.sensor, step.seq) for step in odometry]
    assert spans == [((1, 2), "/odom", 0), ((2, 3), "/odom", 1), ((3, 4), "/odom", 2)]
    assert [step.distance_m for step in odometry] == pytest.approx([1.0, CHORD_M, 1.0], abs=1e-15)
    assert [step.turn_rad for step in odometry] == pytest.approx([0.0, math.pi / 2, 0.0], abs=1e-15)
    assert all(step.measured for step in odometry)


def test_increments_of_any_drive_along_arcs_add_up_to_the_robots_own_pose(tmp_path, ros):
    random = np.random.default_rng(3)
    motion, rows = Increment(), []
    for k, (distance, turn) in enumerate(zip(random.normal(0.0, 0.3, 40), random.normal(0.0, 0.5, 40), strict=True)):
        step = Odometry((k + 1) * SECOND, "", k, k * SECOND, distance, turn)
        motion = motion.extend(step, WORLD.robot.noise)
        rows.append(("/odom", k * SECOND, ros.odometry((k + 1) * SECOND, *motion.pose)))
    rows.insert(0, ("/odom", 0, ros.odometry(0, 0.0, 0.0, 0.0)))
    again = Increment()
    for step in read_bag(ros.bag(tmp_path / "bag", rows), WORLD).measurements:
        again = again.extend(step, WORLD.robot.noise)
    assert again.pose == pytest.approx(motion.pose, abs=1e-12)


def test_measurements_come_in_the_order_they_arrived_and_late_odometry_is_chained_by_its_stamp(tmp_path, ros):
    rows = [
        ("/odom", 1 * SECOND, ros.odometry(1 * SECOND, 1.0, 0.0, 0.0)),
        ("/odom", 3 * SECOND, ros.odometry(3 * SECOND, 3.0, 0.0, 0.0)),
        ("/imu", 4 * SECOND, ros.imu(2 * SECOND, 0.5)),
        ("/odom", 5 * SECOND, ros.odometry(2 * SECOND, 2.5, 0.0, 0.0)),
        ("/odom", 6 * SECOND, ros.odometry(2 * SECOND, 9.0, 9.0, 0.0)),  # a stamp met twice: the first counts
    ]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD)
    assert run.measurements == (
        Gyro(2 * SECOND, "/imu", 0, 0.5, GRAVITY),
        Odometry(2 * SECOND, "/odom", 0, 1 * SECOND, 1.5, 0.0),
        Odometry(3 * SECOND, "/odom", 1, 2 * SECOND, 0.5, 0.0),
    )


def test_odometry_that_was_started_anew_counts_as_motion_not_measured(tmp_path, ros):
    places = ((1, 100.0), (2, 101.0), (3, 0.0), (4, 1.0))
    rows = [("/odom", t * SECOND, ros.odometry(t * SECOND, x, 0.0, 0.0)) for t, x in places]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD)
    assert [(step.distance_m, step.measured) for step in run.measurements] == [(1.0, True), (0.0, False), (1.0, True)]
    (warning,) = run.warnings
    assert "/odom: jumps 1 times" in warning


def test_sideways_motion_is_reported(tmp_path, ros):
    rows = [("/odom", t * SECOND, ros.odometry(t * SECOND, 1.0 * t, 0.5 * t, 0.0)) for t in range(3)]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD)
    assert [step.distance_m for step in run.measurements] == [1.0, 1.0]
    assert "1.00 m of sideways motion are left out, 2.00 m forward are kept" in run.warnings[0]


@pytest.mark.parametrize("asked", [{}, {"wheels": "/joint_states"}, {"wheels": "/joint_states:left_wheel,right_wheel"}])
def test_wheel_angles_become_odometry_by_circumference_and_track(tmp_path, ros, asked):
    angles = ((1, 0.0, 0.0), (2, 1.0, 2.0), (3, 2.0, 2.0))
    rows = [
        ("/joint_states", t * SECOND, ros.joints(t * SECOND, right_wheel=right, arm=9.0, left_wheel=left))
        for t, left, right in angles
    ]
    rows.insert(1, ("/joint_states", SECOND + 1, ros.joints(SECOND + 1, arm=8.0)))
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD, asked)
    reported = [(step.from_ns, step.time_ns, step.distance_m, step.turn_rad) for step in run.measurements]
    assert reported == [
        (SECOND, 2 * SECOND, pytest.approx(0.15, abs=1e-15), pytest.approx(0.2, abs=1e-15)),
        (2 * SECOND, 3 * SECOND, pytest.approx(0.05, abs=1e-15), pytest.approx(-0.2, abs=1e-15)),
    ]
    assert run.metadata["topics"] == "wheels=/joint_states:left_wheel,right_wheel"


def test_wheel_angles_are_calibrated_as_the_ticks_of_the_world_are(tmp_path, ros):
    robot = {**TABLE["robot"], "distance_scale": 2.0, "distance_offset_m": 0.01}
    rows = [
        ("/joints", t * SECOND, ros.joints(t * SECOND, left=angle, right=angle))
        for t, angle in enumerate((0.0, 1.0, 2.0, 2.0, 1.0))
    ]
    run = read_bag(ros.bag(tmp_path / "bag", rows), World.from_table({**TABLE, "robot": robot}))
    assert [step.distance_m for step in run.measurements] == pytest.approx([0.21, 0.2, 0.0, -0.21], abs=1e-15)


@pytest.mark.parametrize(
    ("drive", "asked", "sentence"),
    [
        ("differential", "/joints", r"\(arm, front_left, front_right, rear_left\) are the wheels \(left, right\)\?"),
        ("differential", "/joints:front_left", "Name them: wheels=/joints:JOINT"),
        ("differential", "/joints:front_left,front_rigth", "no joint 'front_rigth'; did you mean 'front_right'"),
        ("skid_steer", "/joints", r"are the wheels \(front left, front right, rear left, rear right\)\?"),
        ("none", "/joints", "robot.drive is 'none'"),
    ],
)
def test_joints_that_may_not_be_the_wheels_are_refused(tmp_path, ros, drive, asked, sentence):
    joints = ros.joints(SECOND, rear_left=0.0, front_right=0.0, arm=0.0, front_left=0.0)
    bag = ros.bag(tmp_path / "bag", [("/joints", SECOND, joints)])
    world = World.from_table({**TABLE, "robot": {"drive": drive}})
    with pytest.raises(ParameterError, match=sentence):
        read_bag(bag, world, {"wheels": asked})


def test_odometry_is_preferred_to_wheels_and_both_are_refused(tmp_path, ros, drive):
    rows = [*drive, *(("/joints", t * SECOND, ros.joints(t * SECOND, left=1.0 * t, right=1.0 * t)) for t in (1, 2))]
    bag = ros.bag(tmp_path / "bag", rows)
    assert {step.sensor for step in of(read_bag(bag, WORLD), Odometry)} == {"/odom"}
    assert {step.sensor for step in of(read_bag(bag, WORLD, {"wheels": "/joints"}), Odometry)} == {"/joints"}
    assert {step.sensor for step in of(read_bag(bag, WORLD, {"odom": "none"}), Odometry)} == {"/joints"}
    with pytest.raises(ParameterError, match="count the motion twice"):
        read_bag(bag, WORLD, {"odom": "/odom", "wheels": "/joints"})


def test_imu_that_measures_no_rate_is_counted(tmp_path, ros):
    rows = [("/imu", t * SECOND, ros.imu(t * SECOND, 0.5, measured=t == 2)) for t in range(1, 4)]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD)
    assert run.measurements == (Gyro(2 * SECOND, "/imu", 0, 0.5, GRAVITY),)
    assert "2 messages of /imu cannot be decoded" in run.warnings[0]


def test_variance_of_a_newer_range_is_its_spread_and_zero_is_none(tmp_path, newer_ros):
    rows = [
        ("/uwb", SECOND, newer_ros.range(SECOND, "a", 2.5, variance=0.25)),
        ("/uwb", 2 * SECOND, newer_ros.range(2 * SECOND, "b", math.inf, variance=0.0)),
    ]
    run = read_bag(newer_ros.bag(tmp_path / "bag", rows), WORLD)
    assert [scan.readings for scan in run.measurements] == [
        (RangeReading("a", 2.5, 0.5),),
        (RangeReading("b", math.inf, None),),
    ]


def test_ranges_are_of_the_anchor_that_the_mapping_names(tmp_path, ros):
    rows = [(f"/uwb{i}", SECOND, ros.range(SECOND, "tag", 1.5 * i)) for i in (1, 2)]
    bag = ros.bag(tmp_path / "bag", rows)
    run = read_bag(bag, WORLD, {"range.b": "/uwb1", "range.c": "/uwb2"})
    assert [scan.readings[0] for scan in run.measurements] == [RangeReading("b", 1.5), RangeReading("c", 3.0)]
    assert run.warnings == ()


def test_ranges_of_no_anchor_are_left_out_and_reported_unless_they_are_named(tmp_path, ros):
    rows = [("/sonar", SECOND, ros.range(SECOND, "bumper", 0.5)), ("/uwb", SECOND, ros.range(SECOND, "a", 1.5))]
    bag = ros.bag(tmp_path / "bag", rows)
    run = read_bag(bag, WORLD)
    assert [scan.sensor for scan in run.measurements] == ["/uwb"]
    assert "/sonar has ranges of what is no anchor of the world (bumper)" in run.warnings[0]
    assert [scan.readings[0].anchor for scan in read_bag(bag, WORLD, {"range": "/sonar"}).measurements] == ["bumper"]


def test_anchor_that_two_topics_range_to_is_refused_until_one_is_named(tmp_path, ros):
    rows = [(topic, SECOND, ros.range(SECOND, name, 1.0)) for topic, name in (("/a", "a"), ("/a2", "a"), ("/b", "b"))]
    bag = ros.bag(tmp_path / "bag", rows)
    with pytest.raises(ParameterError, match=r"range\.a could be /a or /a2; choose one"):
        read_bag(bag, WORLD)
    assert [scan.sensor for scan in read_bag(bag, WORLD, {"range.a": "/a2"}).measurements] == ["/a2", "/b"]
    assert [scan.sensor for scan in read_bag(bag, WORLD, {"range.a": "none"}).measurements] == ["/b"]


def test_our_own_ranges_keep_their_readings(tmp_path, ros):
    bag = ros.bag(tmp_path / "bag", [("/uwb", SECOND, ros.ranges(SECOND, a=1.5, c=2.5))])
    readings = (RangeReading("a", 1.5), RangeReading("c", 2.5))
    assert read_bag(bag, WORLD).measurements == (Ranges(SECOND, "/uwb", 0, readings),)
    with pytest.raises(ParameterError, match="is of the type fusion_msgs/msg/Ranges, and not sensor_msgs/msg/Range"):
        read_bag(bag, WORLD, {"range.a": "/uwb"})


@pytest.mark.parametrize("kind", ["pose", "pose_with_covariance", "odometry", "transforms"])
def test_truth_of_every_type_is_moved_into_the_map(tmp_path, ros, kind):
    heading = 0.25
    message = {
        "pose": lambda: ros.pose(SECOND, 1.0, 2.0, heading),
        "pose_with_covariance": lambda: ros.pose_with_covariance(SECOND, 1.0, 2.0, heading),
        "odometry": lambda: ros.odometry(SECOND, 1.0, 2.0, heading),
        "transforms": lambda: ros.transforms(
            (SECOND, "/map", "odom", 8.0, 8.0, 0.0),
            (SECOND, "map", "/base_link", 1.0, 2.0, heading),
            (SECOND, "map", "nan", math.nan, 2.0, heading),
        ),
    }[kind]()
    topic = "tf:map>base_link" if kind == "transforms" else "/truth"
    bag = ros.bag(tmp_path / "bag", [("/truth", 2 * SECOND, message)])
    run = read_bag(bag, WORLD, {"truth": topic}, truth_to_map=(10.0, 20.0, math.pi / 2))
    assert run.truth.time_ns.tolist() == [SECOND]
    assert (run.truth.x[0], run.truth.y[0]) == pytest.approx((8.0, 21.0), abs=1e-12)
    assert run.truth.heading[0] == pytest.approx(math.pi / 2 + heading, abs=1e-15)
    assert run.measurements == ()
    assert "holds no measurements" in run.warnings[-1]
    still = read_bag(bag, WORLD, {"truth": topic})
    assert (still.truth.x[0], still.truth.y[0], still.metadata["topics"]) == (1.0, 2.0, f"truth={topic}")


@pytest.mark.parametrize("unknown", [None, math.nan])
@pytest.mark.parametrize("kind", ["pose", "pose_with_covariance", "odometry", "transforms"])
def test_pose_without_rotation_is_truth_without_heading_row_by_row(tmp_path, ros, kind, unknown):
    def message(t, heading):
        if kind == "transforms":
            return ros.transforms((t * SECOND, "map", "base_link", 1.0 * t, 2.0, heading))
        return getattr(ros, kind)(t * SECOND, 1.0 * t, 2.0, heading)

    rows = [("/gt", t * SECOND, message(t, heading)) for t, heading in ((1, unknown), (2, 0.5), (3, unknown))]
    topic = "tf:map>base_link" if kind == "transforms" else "/gt"
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD, {"truth": topic, "odom": "none"})
    assert run.truth.x.tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(run.truth.heading).tolist() == [True, False, True]
    assert run.truth.heading[1] == pytest.approx(0.5, abs=1e-15)
    assert (run.prior.position_known, run.prior.heading_known) == (True, False)
    assert run.warnings == (f"{tmp_path / 'bag'}: holds no measurements",)


@pytest.mark.parametrize("unknown", [None, math.nan])
def test_odometry_without_orientation_is_not_chained_and_counted(tmp_path, ros, unknown):
    poses = [(t, x, y, unknown if t == 2 else heading) for t, x, y, heading in POSES]
    rows = [("/odom", t * SECOND, ros.odometry(t * SECOND, x, y, heading)) for t, x, y, heading in poses]
    run = read_bag(ros.bag(tmp_path / "some", rows), WORLD)
    first, last = of(run, Odometry)
    assert (first.from_ns, first.time_ns, last.from_ns) == (SECOND, 3 * SECOND, 3 * SECOND)
    assert first.turn_rad == pytest.approx(math.pi / 2)
    assert any("/odom: 1 of 4 poses lack heading or position, and are left out" in warning for warning in run.warnings)
    blind = [("/odom", t * SECOND, ros.odometry(t * SECOND, x, y, unknown)) for t, x, y, _ in POSES]
    none = read_bag(ros.bag(tmp_path / "none", [*blind, ("/imu", SECOND, ros.imu(SECOND, 0.1))]), WORLD)
    assert of(none, Odometry) == []
    assert any("/odom: 4 of 4 poses lack heading" in warning for warning in none.warnings)


def test_truth_is_never_guessed_and_its_candidates_are_named(tmp_path, ros, drive):
    rows = [*drive, ("/goal_pose", SECOND, ros.pose(SECOND, 9.0, 9.0))]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD)
    assert run.truth is None
    assert run.prior is None
    assert "no truth is named, so errors cannot be scored; it may be in /mocap or /goal_pose" in run.warnings[0]


@pytest.mark.parametrize(
    ("topics", "sentence"),
    [
        ({"gryo": "/imu/data"}, "there is no role 'gryo'; did you mean 'gyro'"),
        ({"range.d": "/uwb/a"}, "the world has no anchor 'd'; known: a, b, c"),
        ({"gyro": "/imu/dat"}, "there is no topic '/imu/dat'; did you mean '/imu/data'"),
        ({"gyro": "/odom"}, "/odom is of the type nav_msgs/msg/Odometry, and not sensor_msgs/msg/Imu"),
        ({"truth": "tf:map>base"}, r"no message transforms map>base .*; did you mean 'map>base_link'"),
        ({"truth": "tf:map"}, "does not name two frames; write it as 'truth=tf:map>base_link', in quotes"),
        ({"truth": "/tf"}, r"/tf holds transforms \(map>base_link\); name one: write it as 'truth="),
        ({"truth": "/odom", "odom": "/odom"}, "/odom is named for two roles"),
        ({"range.a": "/uwb/a", "range.b": "/uwb/a"}, "/uwb/a is named for two roles"),
    ],
)
def test_mapping_that_cannot_be_meant_is_refused_with_the_nearest(tmp_path, ros, drive, topics, sentence):
    rows = [*drive, ("/tf", SECOND, ros.transforms((SECOND, "map", "base_link", 0.0, 0.0, 0.0)))]
    with pytest.raises(ParameterError, match=sentence):
        read_bag(ros.bag(tmp_path / "bag", rows), WORLD, topics)


@pytest.mark.parametrize("role", ["odom", "gyro", "wifi"])
def test_role_that_two_topics_could_play_is_refused_until_one_is_named_or_none(tmp_path, ros, drive, role):
    topic, log_ns, message = next(
        row for row in drive if row[0] == {"odom": "/odom", "gyro": "/imu/data"}.get(role, "/wifi")
    )
    bag = ros.bag(tmp_path / "bag", [*drive, ("/other", log_ns, message)])
    with pytest.raises(ParameterError, match=f"{role} could be {topic} or /other; choose one with {role}={topic}"):
        read_bag(bag, WORLD)
    assert f"{role}=/other" in read_bag(bag, WORLD, {role: "/other"}).metadata["topics"]
    assert f"{role}=" not in read_bag(bag, WORLD, {role: "none"}).metadata["topics"]


def test_odometry_named_as_truth_leaves_the_other_as_odometry(tmp_path, ros):
    rows = [
        (topic, t * SECOND, ros.odometry(t * SECOND, x * t, 0.0, 0.0))
        for t in (1, 2)
        for topic, x in (("/odom", 1.0), ("/gt", 3.0))
    ]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD, {"truth": "/gt"})
    assert run.truth.x.tolist() == [3.0, 6.0]
    assert [step.distance_m for step in run.measurements] == [1.0]


@pytest.mark.parametrize("frame", [(1.0, 2.0), (1.0, 2.0, math.nan)])
def test_frame_of_the_truth_that_is_none_is_refused(tmp_path, ros, drive, frame):
    with pytest.raises(ParameterError, match="are not three numbers"):
        read_bag(ros.bag(tmp_path / "bag", drive), WORLD, {"truth": "/mocap"}, truth_to_map=frame)


@pytest.mark.parametrize("topic", ["/odom", "/imu/data", "/mocap"])
def test_message_that_cannot_be_decoded_is_counted_and_the_others_are_read(tmp_path, ros, drive, topic):
    kind = next(message.__msgtype__ for name, _, message in drive if name == topic)
    rows = [*drive, (topic, 9 * SECOND, SimpleNamespace(type=kind, data=b"\x00\x01\x00\x00short"))]
    run = read_bag(ros.bag(tmp_path / "damaged", rows), WORLD, {"truth": "/mocap"})
    whole = read_bag(ros.bag(tmp_path / "whole", drive), WORLD, {"truth": "/mocap"})
    assert run.measurements == whole.measurements
    assert run.truth.time_ns.tolist() == whole.truth.time_ns.tolist()
    (warning,) = run.warnings
    assert f"1 messages of {topic} cannot be decoded" in warning


def test_pose_that_is_not_finite_is_no_truth(tmp_path, ros):
    rows = [("/gt", t * SECOND, ros.pose(t * SECOND, x, 0.0)) for t, x in ((1, 1.0), (2, math.nan), (3, 3.0))]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD, {"truth": "/gt"})
    assert run.truth.x.tolist() == [1.0, 3.0]
    assert any("1 of 3 true poses have no position, and are left out" in warning for warning in run.warnings)


def test_stamps_that_were_never_set_are_reported(tmp_path, ros):
    run = read_bag(ros.bag(tmp_path / "bag", [("/imu", t, ros.imu(0, 0.5)) for t in (1, 2)]), WORLD)
    assert "all messages of /imu carry one and the same stamp" in run.warnings[0]


def test_bag_cut_off_opens_with_a_warning_and_what_stands_before(tmp_path, ros, drive):
    (file,) = ros.bag(tmp_path / "bag", drive).glob("*.mcap")
    whole = read_bag(file, WORLD)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:-40])
    run = read_bag(cut, WORLD)
    assert run.measurements == whole.measurements
    assert "cut off or damaged" in run.warnings[0]


def test_files_of_a_split_recording_are_one_run_in_the_order_of_their_numbers(tmp_path, ros, drive):
    split = tmp_path / "split"
    split.mkdir()
    for number, row in ((10, drive[2]), (9, drive[1]), (8, drive[0])):
        (file,) = ros.bag(tmp_path / f"part{number}", [row]).glob("*.mcap")
        file.rename(split / f"split_{number}.mcap")
    whole = read_bag(ros.bag(tmp_path / "whole", drive[:3]), WORLD)
    assert read_bag(split, WORLD).measurements == whole.measurements


def test_bag_without_mcap_or_without_anything_of_use_is_refused(tmp_path, ros):
    with pytest.raises(LogError, match=re.escape("holds no *.mcap; convert the bag first")):
        read_bag(tmp_path, WORLD)
    bag = ros.bag(tmp_path / "bag", [("/chatter", 1, ros.make("std_msgs/msg/String", "hello"))])
    with pytest.raises(LogError, match="no message of it is of use"):
        read_bag(bag, WORLD)


def test_imported_bag_is_the_same_run(tmp_path, ros, drive):
    rows = [*drive, ("/imu/data", 9 * SECOND, ros.imu(SECOND + 5, 0.7))]  # a late one keeps its place
    bag = ros.bag(tmp_path / "walk", rows)
    (tmp_path / "world.toml").write_text(tomlkit.dumps(TABLE))
    world = World.load(tmp_path / "world.toml")
    options = {"topics": {"truth": "/mocap"}, "truth_to_map": (1.0, 2.0, 0.5)}
    (path,) = import_recordings("rosbag", bag, tmp_path / "out", world=tmp_path / "world.toml", **options)
    imported, read = read_run(path), read_bag(bag, world, options["topics"], truth_to_map=options["truth_to_map"])
    assert path.name == "walk.mcap"
    assert imported.measurements == read.measurements
    assert imported.measurements[-1].rate_rad_s == 0.7
    assert (imported.name, imported.world, imported.prior) == (read.name, read.world, read.prior)
    for column in ("time_ns", "x", "y"):
        assert getattr(imported.truth, column).tolist() == getattr(read.truth, column).tolist()
    assert imported.truth.heading.tolist() == pytest.approx(read.truth.heading.tolist(), abs=1e-15)  # a quaternion
    assert read.metadata.items() <= imported.metadata.items()
    assert imported.warnings == ()


def test_clock_of_the_log_may_be_another_than_that_of_the_stamps(tmp_path, ros, drive):
    unix_ns = 1_700_000_000 * SECOND
    bag = ros.bag(tmp_path / "bag", [(topic, unix_ns + log_ns, message) for topic, log_ns, message in drive])
    (tmp_path / "world.toml").write_text(tomlkit.dumps(TABLE))
    (path,) = import_recordings(
        "rosbag", bag, tmp_path / "run.mcap", world=tmp_path / "world.toml", topics={"truth": "/mocap"}
    )
    assert read_run(path).measurements == read_bag(bag, WORLD).measurements


def test_command_line_imports_a_bag_and_reports_what_is_doubtful(tmp_path, ros, drive, capsys):
    bag = ros.bag(tmp_path / "bag", drive)
    (tmp_path / "world.toml").write_text(tomlkit.dumps(TABLE))
    out = str(tmp_path / "run.mcap")
    words = ["import", "rosbag", str(bag), "--world", str(tmp_path / "world.toml"), "--topic", "odom=/odom", "-o", out]
    assert main(words) == 0
    reported = capsys.readouterr()
    assert reported.out == f"{out}\n"
    assert reported.err.startswith("warning: ")
    assert "it may be in /mocap" in reported.err
    assert read_run(tmp_path / "run.mcap").metadata["warnings"] in reported.err
    words += ["--topic", "truth=/mocap", "--truth-to-map", "1", "2", "0", "--force"]
    assert main(words) == 0
    assert not capsys.readouterr().err
    assert read_run(tmp_path / "run.mcap").truth.x.tolist() == [1.0 + x for _, x, _, _ in POSES]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["rosbag", "."], "give --world"),
        (["rosbag", ".", "--topic", "odom"], "names no topic; write ROLE=TOPIC"),
        (["rosbag", ".", "--topic", "odom=/a", "--topic", "odom=/b"], "odom is /a already"),
        (["csv", ".", "--topic", "odom=/odom"], "csv takes no topics"),
        (["rosbag", "missing.mcap", "--world", "w.toml"], "no such"),
    ],
)
def test_command_line_that_cannot_be_meant_is_one_sentence(tmp_path, monkeypatch, capsys, words, sentence):
    monkeypatch.chdir(tmp_path)
    assert main(["import", *words, "-o", "out.mcap"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert sentence in line
