"""Bayesian weights against the Kalman filter, against the two-case mixture written out, and against a turned world."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.bayes_weight import BayesWeight
from fusion import Covariance, Decision, Odometry, ParameterError, Pose, Prior, Ranges, Reason, final, track
from fusion.trilateration import Fix
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import Stepped
from tests.worlds import PLACES, exact_ranges, ranged_world

AREA = 30.0 * 40.0
ARM = (0.4, -0.2, 0.0)
BELIEF = Pose(4.0, 3.0, 0.7)
SPREAD = Covariance(0.09, 0.02, -0.01, 0.16, 0.03, 0.04)
FIX = Fix(4.9, 2.6, 0.05, 0.01, 0.03)


BOUNDS = {"x_min": -10.0, "x_max": 20.0, "y_min": -15.0, "y_max": 25.0}


def world(places=PLACES, arm=(0.0, 0.0, 0.0), bias_std_m=0.0):
    ranging = {"std_m": 0.1, "bias_std_m": bias_std_m}
    return ranged_world(places, ranging=ranging, bounds=BOUNDS, robot={"antenna_m": list(arm)})


def scan(k, x, y, names=None):
    """Exact ranges from (x, y), k tenths of a second after the start."""
    return exact_ranges(k * SECOND // 10, k, (x, y), names)


def drive(seconds=30, std=0.1, seed=4, outlier_at=()):
    """A circle at 0.5 m/s: odometry at 10 Hz, ranges to all anchors at 2 Hz."""
    random, pose, measurements, truth = np.random.default_rng(seed), Pose(4.0, 1.0, 0.2), [], []
    for k in range(1, seconds * 10 + 1):
        middle = pose.heading + 0.0075
        pose = Pose(pose.x + 0.05 * math.cos(middle), pose.y + 0.05 * math.sin(middle), pose.heading + 0.015)
        t = k * SECOND // 10
        noisy = 0.05 + random.normal(0, 0.001), 0.015 + random.normal(0, 0.001)
        measurements.append(Odometry(t, "wheels", k, t - SECOND // 10, *noisy))
        if k % 5 == 0:
            x, y = (pose.x + 5.0, pose.y - 4.0) if k in outlier_at else (pose.x, pose.y)
            exact = scan(k, x, y)
            readings = tuple(r._replace(range_m=r.range_m + random.normal(0, std)) for r in exact.readings)
            measurements.append(Ranges(t, "uwb", k, readings))
            truth.append((pose.x, pose.y))
    return measurements, np.array(truth)


def prior(pose=Pose(4.0, 1.0, 0.2), **known):
    return Prior(0, pose, Covariance.from_std(0.2, 0.2, 0.1), **known)


def radio_updates(measurements, start, place=None, **options):
    place = place or world()
    return [u for u in final(track(BayesWeight(place, **options), place, measurements, start)) if u.fates]


def antenna(pose, arm=ARM):
    return np.array(Pose(*pose).transform(*arm[:2]))


def observed(pose, fix, arm=ARM):
    """Innovation of a fix, its Jacobian by finite differences, and its covariance."""
    columns = [(antenna(np.add(pose, d), arm) - antenna(np.subtract(pose, d), arm)) / 2e-6 for d in np.eye(3) * 1e-6]
    return np.array(fix[:2]) - antenna(pose, arm), np.array(columns).T, np.array([fix[2:4], fix[3:5]])


def test_without_outliers_it_is_the_kalman_update():
    """In information form: P' = (P^-1 + Ht R^-1 H)^-1, x' = x + P' Ht R^-1 nu."""
    moved, spread, good = BayesWeight(world(arm=ARM), outlier_probability=0.0).weigh(BELIEF, SPREAD, FIX)
    innovation, h, r = observed(BELIEF, FIX)
    wanted = np.linalg.inv(np.linalg.inv(np.array(SPREAD.matrix)) + h.T @ np.linalg.inv(r) @ h)
    assert good == 1.0
    assert np.allclose(spread.matrix, wanted, rtol=0, atol=1e-9)
    assert np.allclose(moved, BELIEF + wanted @ h.T @ np.linalg.inv(r) @ innovation, rtol=0, atol=1e-9)


def test_without_outliers_even_an_absurd_fix_is_good():
    far = Fix(1e4, 0.0, 0.01, 0.0, 0.01)
    moved, _, good = BayesWeight(world(), outlier_probability=0.0).weigh(
        Pose(0, 0, 0), Covariance.from_std(0.1, 0.1, 0.1), far
    )
    assert good == 1.0
    assert moved.x == pytest.approx(5e3)


def test_weight_worked_out_by_hand():
    """P = R = 0.04 per axis, fix 1.2 m ahead, floor 1200 m^2, prior 0.2. S = 0.08, NIS = 1.44 / 0.08 = 18, density of
    a good fix 1 / (2 pi 0.08) e^-9 = 2.45517e-4, of an outlier 1 / 1200. Odds of an outlier 0.25 / 1200 / 2.45517e-4
    = 0.848550: good = 0.540965. Gain 0.5: x = 0.540965 * 0.6 = 0.324579.
    xx = 0.04 - 0.540965 * 0.02 + 0.540965 * 0.459035 * 0.36 = 0.118577; yy = 0.04 - 0.540965 * 0.02 = 0.0291807.
    """
    estimator = BayesWeight(world(), outlier_probability=0.2)
    belief = Covariance.from_std(0.2, 0.2, 0.1)
    moved, spread, good = estimator.weigh(Pose(0.0, 0.0, 0.0), belief, Fix(1.2, 0.0, 0.04, 0.0, 0.04))
    assert good == pytest.approx(0.540965, abs=2e-6)
    assert moved == pytest.approx((0.324579, 0.0, 0.0), abs=2e-6)
    assert (spread.xx, spread.yy, spread.hh) == pytest.approx((0.118577, 0.0291807, 0.01), abs=2e-6)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_posterior_has_the_moments_of_the_two_cases(share):
    """Case 0, outlier: the belief as it was. Case 1, good: the Kalman update. Mixed by Bayes' rule."""
    place = world(arm=ARM)
    good_mean, good_spread, _ = BayesWeight(place, outlier_probability=0.0).weigh(BELIEF, SPREAD, FIX)
    innovation, h, r = observed(BELIEF, FIX)
    s = h @ np.array(SPREAD.matrix) @ h.T + r
    density = math.exp(-0.5 * innovation @ np.linalg.inv(s) @ innovation) / (math.tau * math.sqrt(np.linalg.det(s)))
    good = (1 - share) * density / ((1 - share) * density + share / AREA)
    means, spreads = np.array([BELIEF, good_mean]), np.array([SPREAD.matrix, good_spread.matrix])
    weights = np.array([1 - good, good])
    mean = weights @ means
    apart = means - mean
    wanted = np.einsum("k,kij->ij", weights, spreads) + np.einsum("k,ki,kj->ij", weights, apart, apart)
    moved, spread, probability = BayesWeight(place, outlier_probability=share).weigh(BELIEF, SPREAD, FIX)
    assert probability == pytest.approx(good, rel=1e-9)
    assert np.allclose(moved, mean, rtol=0, atol=1e-9)
    assert np.allclose(spread.matrix, wanted, rtol=0, atol=1e-9)


def test_an_absurd_fix_changes_nothing():
    moved, spread, good = BayesWeight(world()).weigh(BELIEF, SPREAD, FIX._replace(x=1e4))
    assert good < 1e-200
    assert moved == pytest.approx(BELIEF, abs=1e-12)
    assert spread == pytest.approx(SPREAD, abs=1e-12)


def test_outliers_are_refused_on_the_way_and_the_track_stays():
    measurements, truth = drive(outlier_at=(100, 150, 155, 160, 250))
    updates = radio_updates(measurements, prior())
    doubted = [i for i, u in enumerate(updates) if u.fates[0].decision is Decision.DOWNWEIGHTED]
    assert set(doubted) >= {19, 29, 30, 31, 49}
    assert {u.fates[0].reason for i, u in enumerate(updates) if i in doubted} == {Reason.OUTLIER}
    error = [math.dist(u.estimate.pose[:2], p) for u, p in zip(updates, truth, strict=True)]
    assert max(error) < 0.4


def test_heading_is_corrected_through_its_covariance_with_the_position():
    """After 5 m straight ahead a fix to the left shows that the heading was too far right."""
    robot = Stepped(BayesWeight(world()), Prior(0, Pose(0.0, 3.0, 0.0), Covariance.from_std(0.05, 0.05, 0.2)))
    robot.feed(Odometry(SECOND, "wheels", 1, 0, 5.0, 0.0))
    before = robot.estimate(SECOND)
    fates = robot.feed(scan(10, 5.0, 3.5))
    after = robot.estimate(SECOND)
    assert {f.decision for f in fates} == {Decision.USED}
    assert 0.05 < after.pose.heading < 0.15
    assert after.covariance.hh < 0.5 * before.covariance.hh


@settings(derandomize=True, max_examples=100)
@given(
    root=st.lists(st.floats(-2, 2), min_size=9, max_size=9),
    place=st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
    stds=st.tuples(st.floats(0.01, 10), st.floats(0.01, 10), st.floats(-0.99, 0.99)),
    share=st.floats(0.0, 0.99),
)
def test_covariance_stays_symmetric_and_positive(root, place, stds, share):
    factor = np.reshape(root, (3, 3))
    p = factor @ factor.T
    spread = Covariance(p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2])
    x_std, y_std, correlation = stds
    fix = Fix(*place, x_std**2, correlation * x_std * y_std, y_std**2)
    moved, after, good = BayesWeight(world(arm=ARM), outlier_probability=share).weigh(BELIEF, spread, fix)
    eigenvalues = np.linalg.eigvalsh(np.array(after.matrix))
    assert np.isfinite(moved).all()
    assert 0.0 <= good <= 1.0
    assert eigenvalues[0] >= -1e-9 * max(eigenvalues[-1], 1.0)


def test_turning_and_shifting_the_world_turns_and_shifts_the_answer():
    turned = Pose(3.0, -2.0, 2.2)
    places = {name: turned.transform(*place) for name, place in PLACES.items()}
    measurements, _ = drive(outlier_at=(100,))
    plain = radio_updates(measurements, prior(), world(arm=ARM))
    moved = radio_updates(measurements, prior(turned.compose(Pose(4.0, 1.0, 0.2))), world(places, ARM))
    wanted = [turned.compose(u.estimate.pose) for u in plain]
    assert np.allclose([u.estimate.pose[:2] for u in moved], [w[:2] for w in wanted], rtol=0, atol=1e-5)
    assert [u.fates[0].weight for u in moved] == pytest.approx([u.fates[0].weight for u in plain], abs=1e-5)


def test_unknown_anchor_biases_widen_the_fix():
    spreads = [radio_updates(drive(5)[0], prior(), world(bias_std_m=b))[0].estimate.covariance.xx for b in (0.0, 0.3)]
    assert spreads[1] > 1.5 * spreads[0]


def test_errors_are_as_large_as_claimed_on_the_model_it_assumes():
    """NEES of the position over 20 runs without outliers has mean 2; the 2 Hz fixes are independent."""
    nees = []
    for seed in range(20):
        measurements, truth = drive(15, seed=seed)
        last = radio_updates(measurements, prior(), outlier_probability=0.02)[-1].estimate
        error = np.array(last.pose[:2]) - truth[-1]
        nees.append(error @ np.linalg.solve(np.array(last.covariance.matrix)[:2, :2], error))
    assert 0.5 < np.mean(nees) < 3.5


def test_each_reading_is_used_once_and_anchors_may_come_one_by_one():
    robot = Stepped(BayesWeight(world()), Prior(0, BELIEF, SPREAD))
    reasons = []
    for k, name in enumerate("abccab", start=1):
        reasons += [f.reason for f in robot.feed(scan(k, 4.0, 3.0, (name,)))]
    assert reasons == [Reason.TOO_FEW_ANCHORS, Reason.TOO_FEW_ANCHORS, Reason.OK] * 2


def test_fates_carry_weight_innovation_and_nis_of_every_anchor():
    """Anchor a, seen from (4, 3): 5 m. A fix at (4.4, 3.3) reads 5.5 m."""
    belief = Prior(0, Pose(4.0, 3.0, 0.0), Covariance.from_std(0.3, 0.3, 0.1))
    fates = Stepped(BayesWeight(world()), belief).feed(scan(1, 4.4, 3.3))
    assert [f.anchor for f in fates] == sorted(PLACES)
    assert len({f.weight for f in fates}) == 1
    assert fates[0].innovation == pytest.approx(0.5)
    assert fates[0].innovation_variance == pytest.approx(0.09 + 0.01)
    assert fates[0].nis == pytest.approx(0.25 / 0.1)


@pytest.mark.parametrize("corner", [(4.0, 3.0), (18.0, 23.0), (-9.0, 24.0)])
def test_unknown_position_is_invalid_until_the_first_fix_wherever_on_the_floor(corner):
    place, nowhere = world(), Pose(math.nan, math.nan, math.nan)
    robot = Stepped(
        BayesWeight(place, outlier_probability=0.2), prior(nowhere, position_known=False, heading_known=False)
    )
    before = robot.estimate(0)
    fates = robot.feed(scan(1, *corner))
    after = robot.estimate(SECOND)
    assert not before.valid
    assert np.isfinite([*before.pose, *before.covariance]).all()
    assert after.valid
    assert not after.heading_known
    assert fates[0].weight == pytest.approx(0.8)
    for k in range(2, 8):
        robot.feed(scan(k, *corner))
    assert math.dist(robot.estimate(SECOND).pose[:2], corner) < 0.5


def test_unknown_heading_is_found_by_driving():
    measurements, truth = drive(60)
    updates = radio_updates(measurements, prior(heading_known=False))
    assert not updates[0].estimate.heading_known
    assert updates[-1].estimate.heading_known
    assert math.dist(updates[-1].estimate.pose[:2], truth[-1]) < 0.3


def test_stretch_without_radio_moves_the_belief_and_leaves_waiting_readings_waiting():
    robot = Stepped(BayesWeight(world()), prior())
    robot.feed(scan(1, 4.0, 3.0, ("a",)), Odometry(SECOND, "wheels", 1, SECOND // 10, 1.0, 0.3))
    before, waiting = robot.estimate(SECOND), robot.state.recent
    assert robot.close() == ()
    assert robot.state.recent == waiting != ()
    assert robot.estimate(SECOND) == before


@pytest.mark.parametrize("options", [{"outlier_probability": -0.1}, {"outlier_probability": 1.0}, {"window_s": -1.0}])
def test_impossible_options_are_refused(options):
    with pytest.raises(ParameterError, match="bayes_weight"):
        BayesWeight(world(), **options)
