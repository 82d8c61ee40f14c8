"""Motion before the start of a run counts for nothing."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import Decision, Odometry, Reason, build, final, track, wrap_angle
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.odometry import Odometer
from fusion.robot import Robot
from fusion.values import nanoseconds
from tests.fusion.streams import prior, stepped, world

SECOND = 1_000_000_000


DRIVE = SyntheticRun(noisy=True, duration_s=8.0)


def cut(measurements, at_ns):
    """The measurements of the time after ``at_ns``: the increment across it in two, the first of them left out."""
    for m in measurements:
        if m.time_ns < at_ns or (isinstance(m, Odometry) and m.time_ns == at_ns):
            continue
        if isinstance(m, Odometry) and m.from_ns < at_ns:
            share = (m.time_ns - at_ns) / (m.time_ns - m.from_ns)
            m = replace(m, from_ns=at_ns, distance_m=share * m.distance_m, turn_rad=share * m.turn_rad)  # noqa: PLW2901
        yield m


def started_at(time_ns):
    return replace(DRIVE.prior(), time_ns=time_ns, pose=DRIVE.pose(time_ns))


@pytest.mark.parametrize("name", ["dead_reckoning", "ekf", "particle"])
@given(st.integers(0, nanoseconds(6.0)) | st.integers(0, 60).map(lambda k: k * SECOND // 10))
@settings(derandomize=True, max_examples=15)
def test_run_started_anywhere_counts_no_motion_before_its_start(name, at_ns):
    """Cut between two increments or inside one: as if the odometry before had never been, in pose and noise."""
    measurements, place, start = DRIVE.measurements(), DRIVE.world(), started_at(at_ns)
    whole, later = (
        final(track(build(name, place), place, stream, start, seed=3))
        for stream in (measurements, cut(measurements, at_ns))
    )
    whole = [update for update in whole if not (update.fates and update.fates[0].reason is Reason.TOO_LATE)]
    assert len(whole) == len(later)
    for one, other in zip(whole, later, strict=True):
        assert one.estimate.pose == pytest.approx(other.estimate.pose, abs=1e-9)
        assert one.estimate.covariance == pytest.approx(other.estimate.covariance, abs=1e-9)


@given(st.integers(0, nanoseconds(6.0)) | st.integers(0, 60).map(lambda k: k * SECOND // 10))
@settings(derandomize=True, max_examples=25)
def test_run_started_anywhere_from_the_truth_ends_at_the_truth(at_ns):
    """The odometry is exact but for the arc taken as a chord, so where the cut lies must not show."""
    place = DRIVE.world()
    last = final(track(build("dead_reckoning", place), place, DRIVE.measurements(), started_at(at_ns)))[-1].estimate
    assert math.dist(last.pose[:2], DRIVE.pose(last.time_ns)[:2]) < 1e-3
    assert abs(wrap_angle(last.pose.heading - DRIVE.pose(last.time_ns).heading)) < 1e-9


def test_twist_of_an_increment_across_the_start_is_that_of_all_of_it():
    half = SECOND // 2
    odometer = Odometer(Robot(), half)
    steps = stepped(odometer, Odometry(SECOND, "w", 0, 0, 1.0, 0.2))
    odometer.hold(SECOND + half, steps)
    motion, held = steps
    assert (motion.from_ns, motion.distance_m, motion.turn_rad) == (half, 0.5, 0.1)
    assert (held.distance_m, held.turn_rad) == pytest.approx((0.5, 0.1))


@pytest.mark.parametrize("from_ns", [0, SECOND // 2, SECOND])
def test_increment_over_by_the_start_is_late_and_moves_nothing(from_ns):
    place, start = world(), replace(prior(), time_ns=SECOND)
    (update,) = track(build("dead_reckoning", place), place, [Odometry(SECOND, "w", 0, from_ns, 1.0, 0.2)], start)
    assert [(f.decision, f.reason, f.weight) for f in update.fates] == [(Decision.LATE, Reason.TOO_LATE, 0.0)]
    assert update.estimate.pose == start.pose
    assert update.estimate.covariance == pytest.approx(start.covariance)
