"""Where the host cuts the motion of a run depends on the data alone, and what it makes of each measurement."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion import Decision, Gyro, Increment, MeasurementError, Odometry, RangeReading, Ranges, Reason, WheelTicks, move
from fusion.epochs import LONGEST, FrontEnd, Longest
from tests.fusion.streams import (
    MILLISECOND,
    SECOND,
    WORLD,
    epochs_of,
    integrated,
    joined,
    late_streams,
    moments_of,
    numbers,
    odometry,
    ranges,
    streams,
)

GYRO_WORLD = replace(WORLD, robot=replace(WORLD.robot, turn_source="gyro"))
SHORT = Longest(path_m=0.6, turn_rad=2.5, duration_s=0.7)
RULE = Longest(path_m=20.0, turn_rad=6.25, duration_s=30.0)
NEVER = Longest(math.inf, math.inf, math.inf)


# --- where a stretch is closed ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("distance_m", "turn_rad", "period_ns", "closing"),
    [
        pytest.param(1.0, 0.0, SECOND, 20, id="path: 20 m straight on"),
        pytest.param(-1.0, 0.0, SECOND, 20, id="path: 20 m backwards"),
        pytest.param(0.0, 0.5, SECOND, 13, id="turn: 6.5 rad to the left"),
        pytest.param(0.0, -0.5, SECOND, 13, id="turn: 6.5 rad to the right"),
        pytest.param(0.0, 0.0, SECOND, 30, id="time: 30 s at rest"),
        pytest.param(0.5, 0.5, SECOND, 13, id="whichever is first"),
        pytest.param(0.125, 0.0, SECOND // 10, 160, id="at 10 Hz as well"),
    ],
)
def test_stretch_is_closed_by_path_turn_and_time(distance_m, turn_rad, period_ns, closing):
    measurements = [odometry(k, distance_m, turn_rad, period_ns) for k in range(1, 2 * closing + 2)]
    closed = [(m.time_ns, len(m.epochs)) for m in moments_of(measurements, longest=RULE) if m.epochs]
    assert closed == [(closing * period_ns, 1), (2 * closing * period_ns, 1)]


@pytest.mark.parametrize(
    "turn_rad", [0.0, 0.5 * math.pi, math.pi, 2.0 * math.pi], ids=["straight", "quarter", "half", "circle"]
)
@pytest.mark.parametrize(("turn_error", "turn_bias"), [(0.05, 0.0), (-0.05, 0.0), (0.0, 0.01), (0.0, -0.01)])
def test_first_order_holds_over_the_longest_stretch(turn_rad, turn_error, turn_bias):
    """As `Longest` promises: within 5 % of the path, with a heading off by 0.3 rad."""
    n = 300
    path_m, duration_s = LONGEST.path_m, LONGEST.duration_s

    def driven(turn):
        period_ns = int(duration_s * SECOND) // n
        return integrated([odometry(k, path_m / n, turn / n, period_ns) for k in range(1, n + 1)])

    moved = move(0.0, driven(turn_rad), 0.0, turn_error, turn_bias)
    truth = driven(turn_rad * (1.0 + turn_error) + turn_bias * duration_s)
    assert abs(truth.heading - turn_rad) < 0.32
    assert math.hypot(moved.dx - truth.x, moved.dy - truth.y) < 0.05 * path_m


def test_path_counts_both_ways_and_turns_there_and_back_do_not():
    forth_and_back = [odometry(k, 0.5 * (-1) ** k, 0.0) for k in range(1, 41)]
    assert [m.time_ns for m in moments_of(forth_and_back, longest=RULE) if m.epochs] == [4 * SECOND]
    left_and_right = [odometry(k, 0.0, 2.0 * (-1) ** k) for k in range(1, 200)]
    assert epochs_of(moments_of(left_and_right, longest=RULE)) == []


def test_closed_stretch_ends_with_its_last_message_and_the_next_begins_there():
    measurements = [odometry(k, 1.0, 0.0, SECOND) for k in range(1, 41)]
    first, second = epochs_of(moments_of(measurements, longest=RULE))
    assert (first.time_ns, first.scan, first.motion.time_ns) == (20 * SECOND, None, 20 * SECOND)
    assert second.motion == first.motion._replace(time_ns=40 * SECOND)


def test_scan_begins_a_new_stretch():
    """10 m, a scan, 15 m: neither is long."""
    measurements = [odometry(k, 1.0, 0.0, SECOND) for k in range(1, 26)]
    measurements.insert(10, ranges(10 * SECOND))
    (epoch,) = epochs_of(moments_of(measurements, longest=RULE))
    assert epoch.scan == ranges(10 * SECOND)
    assert epoch.motion.path_m == pytest.approx(10.0)


def test_gap_in_all_sensors_is_closed_before_the_scan_that_ends_it():
    closed, seen = epochs_of(moments_of([odometry(1, 0.1, 0.0), ranges(60 * SECOND)], longest=RULE))
    assert (closed.scan, closed.time_ns) == (None, 60 * SECOND)
    assert closed.motion.unmeasured_s == pytest.approx(60.0 - 0.1 - 0.5)
    assert seen.motion == Increment(time_ns=60 * SECOND)


@given(late_streams())
def test_same_measurements_in_any_order_of_arrival_make_the_same_epochs_to_the_bit(stream):
    in_order, arrived = stream
    expected = epochs_of(moments_of(in_order, longest=SHORT))
    assert repr(epochs_of(moments_of(arrived, longest=SHORT))) == repr(expected)


@given(streams(), st.floats(0.0, 5.0))
def test_epochs_do_not_depend_on_the_horizon(stream, horizon_s):
    expected = epochs_of(moments_of(stream, longest=SHORT))
    assert repr(epochs_of(moments_of(stream, longest=SHORT, horizon_s=horizon_s))) == repr(expected)


@given(streams())
def test_closing_loses_and_adds_no_motion(stream):
    """Stretches closed early, joined up to each scan, are the motion that was never closed."""
    never = epochs_of(moments_of(stream, longest=NEVER))
    early, stretch = [], []
    for epoch in epochs_of(moments_of(stream, longest=SHORT)):
        stretch.append(epoch)
        if epoch.scan is not None:
            early.append((joined(stretch), epoch.scan))
            stretch = []
    assert [scan for _, scan in early] == [epoch.scan for epoch in never]
    for (motion, _), epoch in zip(early, never, strict=True):
        assert numbers(motion) == pytest.approx(numbers(epoch.motion), rel=1e-9, abs=1e-10)


@given(streams())
def test_no_stretch_is_longer_than_allowed_by_more_than_its_last_message(stream):
    longest_message_s = max((m.time_ns - m.from_ns) / SECOND for m in stream if isinstance(m, Odometry))
    epochs = epochs_of(moments_of(stream, longest=SHORT))
    for epoch in epochs:
        assert epoch.motion.duration_s <= SHORT.duration_s + longest_message_s + 1e-9
        assert epoch.time_ns == epoch.motion.time_ns
        reached = (epoch.motion.path_m, abs(epoch.motion.heading), epoch.motion.duration_s)
        assert epoch.scan is not None or any(value >= most for value, most in zip(reached, SHORT, strict=True))
    assert all(one.time_ns <= other.time_ns for one, other in pairwise(epochs))


# --- the front end ---------------------------------------------------------------------------------------------------


def advanced(front_end, *measurements):
    """Motion since the last epoch, epochs and Fates after all measurements."""
    epochs, fates = (), ()
    for measurement in measurements:
        closed, more = front_end.advance(measurement)
        epochs, fates = epochs + closed, fates + more
    return front_end.motion, epochs, fates


def test_motion_is_held_up_to_a_scan_and_counted_once():
    scans = [ranges(1250 * MILLISECOND, 1), ranges(2 * SECOND, 2)]
    driven = [Odometry(SECOND, "w", 0, 0, 1.0, 0.2), Odometry(2 * SECOND, "w", 1, SECOND, 0.8, -0.1)]
    _, epochs, fates = advanced(FrontEnd(WORLD, 0), driven[0], scans[0], driven[1], scans[1])
    assert fates == ()
    assert [epoch.scan for epoch in epochs] == scans
    assert [epoch.time_ns for epoch in epochs] == [1250 * MILLISECOND, 2 * SECOND]
    assert [epoch.motion.path_m for epoch in epochs] == pytest.approx([1.25, 0.55])
    assert [epoch.motion.heading for epoch in epochs] == pytest.approx([0.25, -0.15])
    assert joined(epochs).duration_s == 2.0


def test_wheel_ticks_are_motion_to_every_estimator_alike():
    """Two ticks a wheel of 1.02 cm: 2.04 cm in the second after the first message."""
    front_end = FrontEnd(replace(WORLD, robot=replace(WORLD.robot, drive="differential")), 0)
    ticks = [WheelTicks(SECOND, "e", 0, (5, 5)), WheelTicks(2 * SECOND, "e", 1, (7, 7))]
    motion, epochs, fates = advanced(front_end, *ticks)
    assert (epochs, fates) == ((), ())
    assert motion.x == pytest.approx(0.0204)
    assert motion.time_ns == 2 * SECOND


def test_ticks_of_more_wheels_than_the_robot_has_are_refused():
    with pytest.raises(MeasurementError, match="3 wheels"):
        advanced(FrontEnd(WORLD, 0), WheelTicks(SECOND, "e", 0, (1, 2, 3)))


def test_gyro_that_is_not_the_source_of_turns_gets_its_fate_from_the_host_and_changes_nothing():
    front_end, gyro = FrontEnd(WORLD, 0), Gyro(2 * SECOND, "gyro", 7, 0.3)
    before, _, _ = advanced(front_end, odometry(1))
    epochs, fates = front_end.advance(gyro)
    assert (front_end.motion, epochs) == (before, ())
    assert [(f.time_ns, f.sensor, f.seq, f.anchor) for f in fates] == [(2 * SECOND, "gyro", 7, "")]
    assert [(f.decision, f.reason, f.weight) for f in fates] == [(Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED, 0.0)]


def test_gyro_that_is_the_source_of_turns_has_no_fate_and_turns_the_motion():
    gyro = [Gyro(k * SECOND // 10, "gyro", k, 0.5) for k in range(11)]
    motion, epochs, fates = advanced(FrontEnd(GYRO_WORLD, 0), *gyro, Odometry(SECOND, "w", 0, 0, 0.2, 9.9))
    assert (epochs, fates) == ((), ())
    assert motion.heading == pytest.approx(0.5)


@pytest.mark.parametrize("world", [WORLD, GYRO_WORLD], ids=["wheels turn", "gyro turns"])
def test_gyro_that_is_no_number_is_unusable_wherever_turns_come_from(world):
    _, _, fates = advanced(FrontEnd(world, 0), Gyro(SECOND, "gyro", 0, math.nan))
    assert [(f.decision, f.reason) for f in fates] == [(Decision.UNUSABLE, Reason.NOT_FINITE)]


def test_scan_without_a_usable_reading_closes_nothing_and_motion_goes_on():
    nowhere = Ranges(SECOND, "uwb", 0, (RangeReading("z", 1.0), RangeReading("a", math.nan)))
    half = Ranges(2 * SECOND, "uwb", 1, (RangeReading("z", 1.0), RangeReading("b", 2.0), RangeReading("a", 3.0)))
    _, epochs, fates = advanced(FrontEnd(WORLD, 0), odometry(1), nowhere, odometry(2), half)
    (epoch,) = epochs
    assert [reading.anchor for reading in epoch.scan.readings] == ["a", "b"]
    assert epoch.motion.path_m > 0.1
    assert [fate.reason for fate in fates] == [Reason.UNKNOWN_ANCHOR, Reason.NOT_FINITE, Reason.UNKNOWN_ANCHOR]


def test_motion_held_for_the_asking_closes_nothing_and_is_that_of_a_scan_then():
    front_end = FrontEnd(WORLD, 0, SHORT)
    motion, _, _ = advanced(front_end, *(odometry(k) for k in range(1, 6)))
    assert front_end.held(3 * SECOND).duration_s == pytest.approx(3.0)
    assert front_end.held(motion.time_ns) == front_end.held(0) == motion
    held = front_end.held(600 * MILLISECOND)
    ((epoch,), _) = front_end.advance(ranges(600 * MILLISECOND))
    assert held == epoch.motion
