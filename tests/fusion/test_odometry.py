"""Wheel ticks, commands and gyro become motion; motion held between messages."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import Gyro, MotorCommand, Odometry, WheelTicks
from fusion.odometry import Odometer, wheel_increment
from fusion.robot import Robot
from fusion.values import nanoseconds
from tests.fusion.streams import Steps, stepped

SECOND = 1_000_000_000


@pytest.mark.parametrize("drive_", [("skid_steer", (3, 5, 3, 5)), ("differential", (3, 5))])
def test_wheel_ticks_become_distance_and_turn(drive_):
    """Left 3 and right 5 ticks of 1.02 cm at a track of 0.15 m: 4.08 cm forward, 2.04/15 rad to the left."""
    kind, counts = drive_
    ticks = [WheelTicks(SECOND, "e", 0, (0,) * len(counts)), WheelTicks(2 * SECOND, "e", 1, counts)]
    (motion,) = stepped(Odometer(Robot(drive=kind), 0), *ticks)
    assert motion.distance_m == pytest.approx(0.0408)
    assert motion.turn_rad == pytest.approx(0.0204 / 0.15)


def test_single_channel_encoders_take_their_sign_from_the_command():
    (motion,) = stepped(
        Odometer(Robot(drive="differential", encoder="single_channel"), 0),
        WheelTicks(1, "e", 0, (0, 0)),
        MotorCommand(2, "m", 0, (-0.1, 0.1)),
        WheelTicks(SECOND, "e", 1, (2, 2)),
    )
    assert motion.distance_m == pytest.approx(0.0)
    assert motion.turn_rad == pytest.approx(2 * 2 * 0.0102 / 0.15)


def test_a_wheel_that_rolls_out_after_a_command_to_stand_goes_on_in_its_direction():
    """Left backwards, right forwards; then both are to stand, and each still gives two ticks."""
    (motion,) = stepped(
        Odometer(Robot(drive="differential", encoder="single_channel"), 0),
        MotorCommand(1, "m", 0, (-0.1, 0.1)),
        WheelTicks(2, "e", 0, (9, 9)),
        MotorCommand(3, "m", 1, (0.0, -0.0)),
        WheelTicks(SECOND, "e", 1, (11, 11)),
    )
    assert motion.distance_m == pytest.approx(0.0)
    assert motion.turn_rad == pytest.approx(2 * 2 * 0.0102 / 0.15)


def test_wheels_of_two_sizes_are_distinguished_and_their_mean_is_kept():
    """Borenstein & Feng: with the right wheel 2 % larger, equal counts are a left turn over the same distance."""
    distance, turn = wheel_increment(Robot(drive="differential", track_width_m=0.5, diameter_ratio=1.02), (1.0, 1.0))
    assert distance == pytest.approx(1.0)
    assert turn == pytest.approx(2.0 * 0.02 / 2.02 / 0.5)


def test_gyro_scale_stretches_what_is_left_without_the_bias():
    gyro = [Gyro(k * SECOND // 10, "g", k, 0.6) for k in range(11)]
    (motion,) = stepped(
        Odometer(Robot(drive="differential", turn_source="gyro", gyro_bias_rad_s=0.1, gyro_scale=1.2), 0),
        *gyro,
        Odometry(SECOND, "w", 0, 0, 0.2, 9.9),
    )
    assert motion.turn_rad == pytest.approx(0.6)


def test_gyro_gives_the_turn_where_the_world_makes_it_the_source():
    gyro = [Gyro(k * SECOND // 10, "g", k, 0.6) for k in range(11)]
    (motion,) = stepped(
        Odometer(Robot(drive="differential", turn_source="gyro", gyro_bias_rad_s=0.1), 0),
        *gyro,
        Odometry(SECOND, "w", 0, 0, 0.2, 9.9),
    )
    assert motion.turn_rad == pytest.approx(0.5)


def test_motion_held_up_to_a_radio_reading_is_counted_once():
    odometer = Odometer(Robot(), 0)
    seen = stepped(odometer, Odometry(SECOND, "w", 0, 0, 1.0, 0.2))
    odometer.hold(SECOND + SECOND // 4, seen)
    odometer.advance(Odometry(2 * SECOND, "w", 1, SECOND, 0.8, -0.1), seen)
    assert [m.time_ns for m in seen] == [SECOND, SECOND + SECOND // 4, 2 * SECOND]
    assert sum(m.distance_m for m in seen) == pytest.approx(1.8)
    assert sum(m.turn_rad for m in seen) == pytest.approx(0.1)


@settings(derandomize=True, max_examples=40)
@given(st.integers(0, nanoseconds(0.004)), st.integers(1, 99), st.floats(0.1, 1.5))
def test_message_stamped_right_behind_the_one_before_makes_no_leap(behind_ns, held_ms, speed_m_s):
    """Steady motion at 10 Hz; a reception held up stamps two messages almost alike, then comes a radio reading."""
    odometer, tenth, step_m = Odometer(Robot(), 0), SECOND // 10, 0.1 * speed_m_s
    stamps, steps = [0, tenth, 3 * tenth, 3 * tenth + behind_ns], Steps()
    for k, (from_ns, until_ns) in enumerate(pairwise(stamps)):
        odometer.advance(Odometry(until_ns, "w", k, from_ns, step_m, 0.2), Steps())
    odometer.hold(stamps[-1] + held_ms * SECOND // 1000, steps)
    (held,) = steps
    assert 0.0 < held.distance_m < 3.0 * step_m
    assert 0.0 < held.turn_rad < 3.0 * 0.2
