"""The particle filter against the extended Kalman filter, from unknown starts, and against itself."""

import math

import numpy as np
import pytest

from estimators.ekf import Ekf
from estimators.particle import HEADING, Particle, moved, resampled
from fusion import Covariance, Decision, Increment, Odometry, ParameterError, Pose, compose, digest
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import NOISE, Stepped, prior, radio_updates
from tests.worlds import circle, ranged_world

WORLD = ranged_world()


def test_cloud_agrees_with_the_extended_kalman_filter_on_an_easy_world():
    measurements, _ = circle()
    ours = radio_updates(Particle(WORLD), WORLD, measurements, prior())
    theirs = radio_updates(Ekf(WORLD), WORLD, measurements, prior())
    apart = [math.dist(a.estimate.pose[:2], b.estimate.pose[:2]) for a, b in zip(ours, theirs, strict=True)]
    assert np.sqrt(np.mean(np.square(apart))) < 0.06
    assert ours[-1].estimate.covariance.xx == pytest.approx(theirs[-1].estimate.covariance.xx, rel=0.5)


def test_noiseless_data_lead_to_the_truth():
    measurements, truth = circle(std_m=0.0)
    last = radio_updates(Particle(WORLD), WORLD, measurements, prior())[-1].estimate
    assert math.dist(last.pose[:2], truth[-1][:2]) < 0.05


@pytest.mark.parametrize("known", [{"heading_known": False}, {"heading_known": False, "position_known": False}])
def test_unknown_start_is_found_by_driving(known):
    measurements, truth = circle(seconds=30)
    updates = radio_updates(Particle(WORLD), WORLD, measurements, prior(**known))
    assert not updates[0].estimate.heading_known
    last = updates[-1].estimate
    assert last.heading_known
    assert math.dist(last.pose[:2], truth[-1][:2]) < 0.3
    assert abs(math.remainder(last.pose.heading - truth[-1].heading, math.tau)) < 0.3


def test_same_seed_gives_the_same_bytes_and_another_seed_others():
    measurements, _ = circle(seconds=5)
    runs = (radio_updates(Particle(WORLD), WORLD, measurements, prior(), seed) for seed in (1, 1, 2))
    one, same, other = map(digest, runs)
    assert one == same != other


def test_an_absurd_range_is_doubted_and_moves_the_cloud_little():
    measurements, truth = circle(outlier_at=150)
    updates = radio_updates(Particle(WORLD), WORLD, measurements, prior())
    fate = updates[29].fates[0]
    assert fate.decision is Decision.DOWNWEIGHTED
    assert fate.weight < 0.01
    assert fate.innovation == pytest.approx(30.0, abs=1.0)
    assert math.dist(updates[29].estimate.pose[:2], truth[29][:2]) < 0.3


def test_moved_cloud_has_the_moments_of_the_composed_increment():
    motion = Increment()
    for k in range(1, 11):
        motion = motion.extend(Odometry(k * SECOND, "w", k, (k - 1) * SECOND, 0.3, 0.1), NOISE)
    cloud = np.zeros((6, 100_000))
    cloud[HEADING] = 0.7
    after = moved(cloud, motion, np.random.default_rng(0))
    pose, covariance = compose(Pose(0.0, 0.0, 0.7), Covariance(0, 0, 0, 0, 0, 0), motion)
    assert np.allclose(after[:3].mean(axis=1), pose, atol=0.01)
    assert np.allclose(np.cov(after[:3]), covariance.matrix, atol=2e-4, rtol=0.03)


def test_resampling_keeps_mean_and_covariance():
    random = np.random.default_rng(5)
    cloud = random.standard_normal((6, 20_000)) * np.array([[2.0], [1.0], [0.3], [0.02], [0.02], [0.002]])
    weights = random.uniform(size=20_000)
    weights /= weights.sum()
    after, equal = resampled(cloud, weights, random)
    assert np.ptp(equal) == 0.0
    assert np.allclose(after.mean(axis=1), cloud @ weights, atol=0.03)
    assert np.allclose(after.std(axis=1), np.sqrt(np.cov(cloud, aweights=weights).diagonal()), rtol=0.03)


@pytest.mark.parametrize(
    "options", [{"particles": 0}, {"outlier_share": 0.0}, {"outlier_share": 1.0}, {"max_correlated": 0.9}]
)
def test_impossible_options_are_refused(options):
    with pytest.raises(ParameterError, match="particle"):
        Particle(WORLD, **options)


def test_particles_are_the_cloud_at_the_last_epoch():
    filter_, measurements = Particle(WORLD), circle(seconds=1)[0]
    robot = Stepped(filter_, prior())
    at_start = filter_.particles(robot.state)
    robot.feed(*measurements[:4])
    assert np.array_equal(filter_.particles(robot.state).positions, at_start.positions)
    assert np.array_equal(at_start.positions, robot.state.cloud[:2].T)
    assert robot.close() == ()
    shown = filter_.particles(robot.state)
    assert np.array_equal(shown.weights, robot.state.weights)
    assert np.array_equal(shown.positions, robot.state.cloud[:2].T)
    moved_m = np.hypot(*(shown.positions - at_start.positions).T)
    assert moved_m.mean() == pytest.approx(0.2, rel=0.01)
    assert moved_m == pytest.approx(np.full(1000, 0.2), abs=0.1)
    assert shown.effective_number == pytest.approx(1000.0)
