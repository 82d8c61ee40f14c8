"""Odometry and wheel angles of a bag become increments."""

import math

import numpy as np
import pytest

from fusion import Gyro, Increment, Odometry, World
from fusion.errors import ParameterError
from logs.importers.rosbag import read_bag
from tests.logs.importers.hall import CHORD_M, GRAVITY, POSES, SECOND, TABLE, WORLD, of


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
