"""Dead reckoning against paths and variances worked out by hand, and against many robots with calibration errors."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.dead_reckoning import DeadReckoning
from fusion import Covariance, Decision, Increment, Odometry, Pose, Prior, RangeReading, Ranges, Reason, compose
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import Stepped
from tests.worlds import empty_world

EXACT = dict.fromkeys(
    (
        "distance_std_per_sqrt_m",
        "distance_std_per_sqrt_s",
        "side_std_per_sqrt_m",
        "turn_std_per_sqrt_rad",
        "turn_std_per_sqrt_m",
        "turn_std_per_sqrt_s",
        "distance_scale_std",
        "turn_scale_std",
        "turn_bias_std_rad_s",
    ),
    0.0,
)
CERTAIN = Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
CURVES = [(0.5, 0.1)] * 20 + [(0.4, -0.15)] * 30


def world(**noise):
    return empty_world(robot={"noise": noise})


def exact(**noise):
    return world(**{**EXACT, **noise})


def driven(place, steps, pose=Pose(0.0, 0.0, 0.0), spread=CERTAIN, **known):
    """The estimate after steps of (distance [m], turn [rad]), one a second."""
    robot = Stepped(DeadReckoning(place), Prior(0, pose, spread, **known), place.robot.noise)
    for k, (distance, turn) in enumerate(steps, start=1):
        robot.feed(Odometry(k * SECOND, "wheels", k, (k - 1) * SECOND, distance, turn))
    estimate = robot.estimate(len(steps) * SECOND)
    assert robot.close() == ()
    assert robot.estimate(len(steps) * SECOND) == estimate
    return estimate


def test_path_worked_out_by_hand():
    """From (1, 1) looking along x: 2 m ahead, a quarter turn left on the spot, 1 m ahead: (3, 2) looking along y."""
    estimate = driven(exact(), [(2.0, 0.0), (0.0, math.pi / 2), (1.0, 0.0)], Pose(1.0, 1.0, 0.0))
    assert estimate.pose == pytest.approx((3.0, 2.0, math.pi / 2))
    assert estimate.covariance == pytest.approx((0.0,) * 6)


def test_distance_scale_error_worked_out_by_hand():
    """10 m ahead with 2 % scale error: 0.2 m along the path, nothing across."""
    estimate = driven(exact(distance_scale_std=0.02), [(1.0, 0.0)] * 10)
    assert estimate.covariance == pytest.approx((0.04, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_turn_scale_error_worked_out_by_hand():
    """2 rad on the spot with 2 % scale error: 0.04 rad."""
    estimate = driven(exact(turn_scale_std=0.02), [(0.0, 0.5)] * 4)
    assert estimate.covariance == pytest.approx((0.0, 0.0, 0.0, 0.0, 0.0, 0.0016))


def test_turn_bias_error_worked_out_by_hand():
    """10 m ahead in 10 s with 0.01 rad/s: heading 0.1 rad; sideways 0.01 (0.5 + 1.5 + ... + 9.5) = 0.5 m."""
    estimate = driven(exact(turn_bias_std_rad_s=0.01), [(1.0, 0.0)] * 10)
    assert estimate.covariance == pytest.approx((0.0, 0.0, 0.0, 0.25, 0.05, 0.01))


def test_covariance_is_the_scatter_of_many_robots_with_calibration_errors():
    random, robots = np.random.default_rng(1), 20_000
    stds = {"distance_scale_std": 0.02, "turn_scale_std": 0.02, "turn_bias_std_rad_s": 0.001}
    scale, turn_scale, bias = (random.normal(0.0, std, robots) for std in stds.values())
    x, y, heading = np.zeros((3, robots))
    for distance, turn in CURVES:
        real = turn * (1.0 + turn_scale) + bias
        x += distance * (1.0 + scale) * np.cos(heading + real / 2)
        y += distance * (1.0 + scale) * np.sin(heading + real / 2)
        heading += real
    scatter = np.cov(np.array([x, y, heading]))
    claimed = np.array(driven(exact(**stds), CURVES).covariance.matrix)
    assert np.allclose(claimed, scatter, rtol=0.05, atol=0.02 * scatter.max())


def test_without_calibration_errors_it_is_the_composed_motion():
    place = world(distance_scale_std=0.0, turn_scale_std=0.0, turn_bias_std_rad_s=0.0)
    pose, spread = Pose(2.0, 1.0, 0.7), Covariance(0.1, 0.02, 0.01, 0.2, -0.03, 0.05)
    estimate = driven(place, CURVES, pose, spread)
    for k, (distance, turn) in enumerate(CURVES):
        step = Odometry((k + 1) * SECOND, "wheels", k, k * SECOND, distance, turn)
        pose, spread = compose(pose, spread, Increment().extend(step, place.robot.noise))
    assert estimate.pose == pytest.approx(pose, abs=1e-12)
    assert estimate.covariance == pytest.approx(spread, abs=1e-12)


def test_radio_is_unusable_and_changes_nothing():
    estimator = DeadReckoning(world())
    before = estimator.start(Prior(0, Pose(1.0, 2.0, 0.3), Covariance.from_std(0.1, 0.1, 0.1)), 0)
    ranges = Ranges(SECOND, "uwb", 1, (RangeReading("a", 1.0), RangeReading("b", 2.0)))
    after, fates = estimator.step(before, Increment(), ranges)
    assert after == before
    assert [f.anchor for f in fates] == ["a", "b"]
    assert {(f.decision, f.reason, f.weight) for f in fates} == {(Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED, 0.0)}


def test_unknown_start_is_reported_and_gives_no_nan():
    nowhere = Pose(math.nan, math.nan, math.nan)
    estimate = driven(world(), CURVES, nowhere, position_known=False, heading_known=False)
    assert not estimate.valid
    assert not estimate.heading_known
    assert np.isfinite([*estimate.pose, *estimate.covariance]).all()


def test_known_position_with_unknown_heading_is_valid_and_reports_the_heading():
    estimate = driven(world(), [], Pose(1.0, 1.0, 2.0), heading_known=False)
    assert estimate.valid
    assert not estimate.heading_known


@settings(derandomize=True, max_examples=50)
@given(
    shift=st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1)),
    steps=st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=1, max_size=30),
)
def test_turning_and_shifting_the_start_turns_and_shifts_the_answer(shift, steps):
    moved = Pose(*shift)
    plain, turned = driven(world(), steps), driven(world(), steps, moved)
    assert turned.pose[:2] == pytest.approx(moved.transform(*plain.pose[:2]), abs=1e-9)
    c, s = math.cos(moved.heading), math.sin(moved.heading)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    wanted = rotation @ np.array(plain.covariance.matrix) @ rotation.T
    assert np.allclose(turned.covariance.matrix, wanted, rtol=1e-9, atol=1e-9)
    assert np.linalg.eigvalsh(wanted).min() > -1e-9
