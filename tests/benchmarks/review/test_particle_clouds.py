"""The particles of an estimator: watched without changing it, a bounded number of them kept."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.review.particle_clouds import MOST_CLOUDS, MOST_POINTS, CloudWatch, thinned
from benchmarks.runner.estimator_run import run_estimator
from fusion import Epoch, Increment, Moment, Particles, Ranges, WifiScan

MANY = np.random.default_rng(1)


def test_watching_changes_nothing_and_keeps_the_cloud_of_every_scan(run):
    watch = CloudWatch(run)
    estimator_run = run_estimator(run, "particle", {"particles": 300}, watch=watch)
    assert estimator_run.digest == run_estimator(run, "particle", {"particles": 300}).digest
    clouds = watch.clouds()
    scans = {m.time_ns for m in run.measurements if isinstance(m, WifiScan | Ranges)}
    assert clouds.cloud_ns.tolist() == clouds.time_ns.tolist() == sorted(scans)
    assert (clouds.lengths == 300).all()
    assert ((clouds.effective_number >= 1.0) & (clouds.effective_number <= 300.001)).all()
    by_time = {update.estimate.time_ns: update.estimate for update in estimator_run.final}
    first = clouds.weights[:300] @ clouds.positions[:300]
    assert first == pytest.approx(by_time[int(clouds.cloud_ns[0])].pose[:2], abs=1e-9)


def test_estimator_without_particles_has_no_clouds(run):
    watch = CloudWatch(run)
    assert run_estimator(run, "ekf", watch=watch).error is None
    assert watch.clouds() is None


def test_particles_that_fail_cost_their_own_lane_alone(run):
    def refuse(fold, moment):
        raise ValueError("no particles today")

    assert "no particles today" in run_estimator(run, "ekf", watch=refuse).error


class Always:
    """A fold whose cloud is the same at all times."""

    def particles(self):
        return Particles(np.zeros((2, 2)), np.array([0.5, 0.5]))


@pytest.mark.parametrize("scans", [MOST_CLOUDS, MOST_CLOUDS + 1, 10 * MOST_CLOUDS - 1])
def test_of_a_long_run_a_bounded_number_of_clouds_is_kept(run, scans):
    radio = tuple(Ranges(1 + k, "uwb", k, ()) for k in range(scans))
    watch = CloudWatch(replace(run, measurements=radio))
    for k, measurement in enumerate(radio):
        watch(Always(), Moment(measurement, (), k, (Epoch(1 + k, Increment(), measurement),), 1 + k, 0, False, None, 0))
    clouds = watch.clouds()
    assert len(clouds.time_ns) == scans
    assert MOST_CLOUDS / 2 < len(clouds.cloud_ns) <= MOST_CLOUDS
    assert clouds.effective_number == pytest.approx(2.0)


def test_thinned_cloud_is_small_and_stands_for_the_whole():
    weights = MANY.exponential(size=4000)
    cloud = Particles(MANY.normal((3.0, -2.0), 1.0, (4000, 2)), weights / weights.sum())
    small = thinned(cloud)
    assert len(small.weights) <= MOST_POINTS
    assert small.weights.sum() == pytest.approx(1.0)
    mean = cloud.weights @ cloud.positions
    # Systematic resampling strays less than independent draws, whose mean has this deviation.
    assert np.abs(small.weights @ small.positions - mean).max() < 3.0 / np.sqrt(MOST_POINTS)
    assert thinned(small) is small


def test_heavy_particle_keeps_its_weight_in_a_thinned_cloud():
    weights = np.full(1001, 0.5 / 1000)
    weights[700] = 0.5
    small = thinned(Particles(np.arange(2002.0).reshape(1001, 2), weights))
    assert small.weights.max() == pytest.approx(0.5, abs=2.0 / MOST_POINTS)
    assert small.positions[np.argmax(small.weights)].tolist() == [1400.0, 1401.0]
