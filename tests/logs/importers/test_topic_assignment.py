"""Topics of a bag and their roles: by name, by type, and refused where two could be meant."""

import pytest

from fusion import Odometry, RangeReading
from fusion.errors import ParameterError
from logs.importers.rosbag import read_bag
from tests.logs.importers.hall import SECOND, WORLD, of


def test_odometry_is_preferred_to_wheels_and_both_are_refused(tmp_path, ros, drive):
    rows = [*drive, *(("/joints", t * SECOND, ros.joints(t * SECOND, left=1.0 * t, right=1.0 * t)) for t in (1, 2))]
    bag = ros.bag(tmp_path / "bag", rows)
    assert {step.sensor for step in of(read_bag(bag, WORLD), Odometry)} == {"/odom"}
    assert {step.sensor for step in of(read_bag(bag, WORLD, {"wheels": "/joints"}), Odometry)} == {"/joints"}
    assert {step.sensor for step in of(read_bag(bag, WORLD, {"odom": "none"}), Odometry)} == {"/joints"}
    with pytest.raises(ParameterError, match="count the motion twice"):
        read_bag(bag, WORLD, {"odom": "/odom", "wheels": "/joints"})


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
