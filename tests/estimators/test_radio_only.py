"""Trilateration alone: exact readings, anchors measured one by one, the floor's edge, and what it cannot know."""

import math

import numpy as np
import pytest

from estimators.radio_only import RadioOnly
from fusion import (
    Covariance,
    Decision,
    Increment,
    Odometry,
    ParameterError,
    Pose,
    Prior,
    Ranges,
    Reason,
    RssiReading,
    WifiScan,
)
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import Stepped
from tests.worlds import PLACES, exact_ranges, ranged_world

THREE = ("a", "b", "c")
NOWHERE = Prior(
    0, Pose(math.nan, math.nan, math.nan), Covariance.from_std(1, 1, 1), position_known=False, heading_known=False
)


def world(places=PLACES, **tables):
    return ranged_world(places, ranging={"std_m": 0.1}, **tables)


def scan(time_s, x, y, names=THREE, places=PLACES):
    """Exact ranges from (x, y) to the anchors ``names``."""
    return exact_ranges(round(time_s * SECOND), round(time_s * 1000), (x, y), names, places)


def after(measurements, place=None, **options):
    """The estimator after all measurements, and the Fates of the last."""
    robot = Stepped(RadioOnly(place or world(), **options), NOWHERE)
    return robot, robot.feed(*measurements)


def answer(measurements, **options):
    return after(measurements, **options)[0].estimate(measurements[-1].time_ns)


@pytest.mark.parametrize("names", [THREE, tuple(PLACES)])
def test_exact_ranges_give_the_exact_place_and_no_heading(names):
    estimate = answer([scan(1, 3.0, 2.0, names)])
    assert estimate.pose[:2] == pytest.approx((3.0, 2.0), abs=1e-6)
    assert estimate.valid
    assert not estimate.heading_known


def test_exact_signal_strengths_give_the_exact_place():
    place = world()
    readings = tuple(
        RssiReading(n, float(place.anchor(n).radio.expected(math.hypot(3.0 - x, 2.0 - y))))
        for n, (x, y) in PLACES.items()
    )
    assert answer([WifiScan(SECOND, "wifi", 1, readings)]).pose[:2] == pytest.approx((3.0, 2.0), abs=1e-6)


def test_nothing_is_claimed_before_the_first_fix():
    robot, fates = after([scan(1, 3.0, 2.0, ("a", "b"))])
    estimate = robot.estimate(SECOND)
    assert not estimate.valid
    assert estimate.covariance is None
    assert np.isfinite(estimate.pose).all()
    assert {(f.decision, f.reason, f.weight) for f in fates} == {(Decision.UNUSABLE, Reason.TOO_FEW_ANCHORS, 0.0)}


def test_anchors_measured_one_by_one_make_a_fix_inside_the_window_only():
    one_by_one = [scan(t, 3.0, 2.0, (name,)) for t, name in enumerate(THREE)]
    assert answer(one_by_one, window_s=2.0).pose[:2] == pytest.approx((3.0, 2.0), abs=1e-6)
    assert after(one_by_one, window_s=1.9)[1][0].reason is Reason.TOO_FEW_ANCHORS


def test_anchors_on_one_line_make_no_fix():
    line = {"a": (0.0, 0.0), "b": (4.0, 0.0), "c": (8.0, 0.0), "d": (4.0, 6.0)}
    robot, fates = after([scan(1, 3.0, 2.0, THREE, line)], world(line))
    assert {(f.decision, f.reason) for f in fates} == {(Decision.UNUSABLE, Reason.COLLINEAR_ANCHORS)}
    assert not robot.estimate(SECOND).valid


def test_an_answer_is_good_for_one_second():
    robot, _ = after([scan(1, 3.0, 2.0)])
    assert robot.estimate(2 * SECOND).valid
    assert not robot.estimate(2 * SECOND + 1).valid


def test_a_whole_scan_leaves_no_memory_of_the_one_before():
    last = scan(2, 3.0, 2.0)
    assert answer([scan(1, 6.0, 5.0), last]) == answer([last])


@pytest.mark.parametrize(("clamp", "x"), [(True, 11.0), (False, 15.0)])
def test_a_fix_beyond_the_floor_is_moved_to_its_edge_if_wanted(clamp, x):
    """The floor reaches 2 m beyond the outermost anchor, to x = 9 + 2."""
    assert answer([scan(1, 15.0, 2.0)], clamp_to_bounds=clamp).pose[:2] == pytest.approx((x, 2.0), abs=1e-6)


def test_the_answer_is_the_antennas_place_whatever_its_arm():
    arm = {"antenna_m": [0.5, 0.0, 0.0]}
    assert answer([scan(1, 3.0, 2.0)], place=world(robot=arm)).pose[:2] == pytest.approx((3.0, 2.0), abs=1e-6)


def test_motion_changes_nothing():
    robot, _ = after([scan(1, 3.0, 2.0)])
    still = robot.estimate(2 * SECOND)
    robot.feed(Odometry(2 * SECOND, "wheels", 1, SECOND, 1.0, 0.3))
    assert robot.estimate(2 * SECOND) == still
    assert robot.estimator.step(robot.state, robot.motion, None) == (robot.state, ())
    driven, standing = (
        robot.estimator.step(robot.state, motion, scan(2, 5.0, 4.0)) for motion in (robot.motion, Increment())
    )
    assert driven == standing


def test_covariance_is_the_scatter_of_many_fixes():
    random, fixes = np.random.default_rng(2), []
    for k in range(1000):
        exact = scan(1, 5.0, 4.0, tuple(PLACES))
        noisy = tuple(r._replace(range_m=r.range_m + random.normal(0.0, 0.1)) for r in exact.readings)
        fixes.append(answer([Ranges(SECOND, "uwb", k, noisy)]))
    scatter = np.cov(np.array([fix.pose[:2] for fix in fixes]).T)
    claimed = np.array(fixes[0].covariance.matrix)[:2, :2]
    assert np.allclose(claimed, scatter, rtol=0.15, atol=0.05 * scatter.max())


def test_turning_and_shifting_the_world_turns_and_shifts_the_answer():
    turned = Pose(-3.0, 5.0, 2.2)
    places = {name: turned.transform(*place) for name, place in PLACES.items()}
    long_by = {"a": 0.1, "b": -0.2, "c": 0.3, "d": 0.05}
    measured = scan(1, 3.0, 2.0, tuple(PLACES))
    measured = Ranges(
        SECOND, "uwb", 1, tuple(r._replace(range_m=r.range_m + long_by[r.anchor]) for r in measured.readings)
    )
    plain = answer([measured], clamp_to_bounds=False)
    moved = answer([measured], place=world(places), clamp_to_bounds=False)
    assert moved.pose[:2] == pytest.approx(turned.transform(*plain.pose[:2]), abs=1e-6)


def test_a_negative_window_is_refused():
    with pytest.raises(ParameterError, match="window_s"):
        RadioOnly(world(), window_s=-1.0)
