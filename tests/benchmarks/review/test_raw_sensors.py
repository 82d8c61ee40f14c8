"""Motion sensors as they came, and events of the devices."""

import math

import numpy as np
import pytest

import fusion
from benchmarks.review.raw_sensors import SPEED, TURN_RATE, raw_series, worth_a_line
from fusion import Diagnostic, Gyro, Level, MotorCommand, Odometry, WheelTicks
from logs.run import Run

SECOND_NS = 1_000_000_000
ANCHORS = [{"id": n, "position_m": [i, i * i]} for i, n in enumerate("abc")]
WORLD = fusion.World.from_table(
    {"name": "w", "anchors": ANCHORS, "robot": {"ticks_per_revolution": 100, "wheel_circumference_m": 0.5}}
)


def test_wheel_speed_is_the_way_between_two_messages():
    ticks = [WheelTicks(k * SECOND_NS // 2, "enc", k, (20 * k, -10 * k)) for k in range(3)]
    series = raw_series(WORLD, ticks)
    time_ns, left = series[SPEED, "enc wheel 0"]
    assert time_ns.tolist() == [SECOND_NS // 2, SECOND_NS]
    assert left.tolist() == pytest.approx([0.2, 0.2])
    assert series[SPEED, "enc wheel 1"][1].tolist() == pytest.approx([-0.1, -0.1])


def test_odometry_gives_mean_rates_of_what_was_measured():
    moved = Odometry(2 * SECOND_NS, "odom", 1, 0, 1.0, math.pi)
    guessed = Odometry(3 * SECOND_NS, "odom", 2, 2 * SECOND_NS, 0.0, 0.0, measured=False)
    empty = Odometry(4 * SECOND_NS, "odom", 3, 4 * SECOND_NS, 0.0, 0.0)
    series = raw_series(WORLD, [moved, guessed, empty])
    assert series[SPEED, "odom"][1].tolist() == [0.5]
    assert series[TURN_RATE, "odom"][1].tolist() == pytest.approx([90.0])


def test_gyro_and_commands_stand_as_they_are_in_time_order():
    command, rate = MotorCommand(5, "motors", 1, (0.3, 0.4)), math.radians(30.0)
    series = raw_series(WORLD, [Gyro(9, "gyro", 2, -rate), Gyro(4, "gyro", 1, rate), command])
    assert series[TURN_RATE, "gyro"][0].tolist() == [4, 9]
    assert series[TURN_RATE, "gyro"][1].tolist() == pytest.approx([30.0, -30.0])
    assert series[SPEED, "motors wheel 1"][1].tolist() == [0.4]


def test_single_message_of_an_encoder_gives_no_speed_and_no_motion_nothing():
    time_ns, speed = raw_series(WORLD, [WheelTicks(0, "enc", 0, (1, 2))])[SPEED, "enc wheel 0"]
    assert len(time_ns) == len(speed) == 0
    assert raw_series(WORLD, []) == {}
    assert np.isfinite(speed).all()


def diagnostic(text, level=Level.WARN):
    return Diagnostic(1, "gyro", level, text)


def test_openings_and_complaints_are_events_and_routine_is_not():
    events = [diagnostic("opened", Level.OK), diagnostic("gone"), diagnostic("broken", Level.ERROR)]
    routine = [diagnostic("status"), diagnostic("status", Level.OK), diagnostic("state of the chip", Level.OK)]
    run = Run(None, "r", None, None, {}, (), None, (), {}, diagnostics=tuple(events + routine))
    assert worth_a_line(run) == events
