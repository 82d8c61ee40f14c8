"""The histogram filter against the extended Kalman filter, from unknown starts, and on a turned floor."""

import math

import numpy as np
import pytest

from estimators.bayes_grid import BayesGrid, floor_kernel, turn_kernel
from estimators.ekf import Ekf
from fusion import Covariance, Decision, Odometry, ParameterError, Pose, Prior, RangeReading, Ranges, digest
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import prior, radio_updates
from tests.worlds import circle, ranged_world

PLACES = {"a": (0.0, 0.0), "b": (8.0, 0.0), "c": (0.5, 8.0), "d": (8.0, 7.0)}
START = Pose(3.0, 1.5, 0.2)
STILL = Pose(0.0, 0.0, 0.0)


def world(map_from_room=STILL, side_m=8.0):
    corners = np.array([map_from_room.transform(x, y) for x in (-1.0, side_m + 1.0) for y in (-1.0, side_m + 1.0)])
    (x_min, y_min), (x_max, y_max) = corners.min(axis=0), corners.max(axis=0)
    bounds = {"x_min": x_min, "x_max": x_max, "y_min": y_min, "y_max": y_max}
    return ranged_world({name: map_from_room.transform(*at) for name, at in PLACES.items()}, bounds=bounds)


def drive(**options):
    return circle(start=START, turn_rad=0.02, places=PLACES, **options)


def test_grid_agrees_with_the_extended_kalman_filter_within_a_cell():
    measurements, _ = drive()
    ours = radio_updates(BayesGrid(world()), world(), measurements, prior(START))
    theirs = radio_updates(Ekf(world()), world(), measurements, prior(START))
    apart = [math.dist(a.estimate.pose[:2], b.estimate.pose[:2]) for a, b in zip(ours, theirs, strict=True)]
    assert np.sqrt(np.mean(np.square(apart))) < 0.15
    assert max(apart) < 0.35


@pytest.mark.parametrize("known", [{"heading_known": False}, {"heading_known": False, "position_known": False}])
def test_unknown_start_is_found_by_driving(known):
    measurements, truth = drive(seconds=30)
    updates = radio_updates(BayesGrid(world()), world(), measurements, prior(START, **known))
    assert not updates[0].estimate.heading_known
    last = updates[-1].estimate
    assert last.heading_known
    assert math.dist(last.pose[:2], truth[-1][:2]) < 0.3
    assert abs(math.remainder(last.pose.heading - truth[-1].heading, math.tau)) < 0.3


def test_turning_and_shifting_the_world_turns_and_shifts_the_answer_within_a_cell():
    measurements, _ = drive()
    plain = radio_updates(BayesGrid(world()), world(), measurements, prior(START))
    turned = Pose(-3.0, 5.0, 2.2)
    place = world(turned)
    answers = radio_updates(BayesGrid(place), place, measurements, prior(turned.compose(START)))
    for before, after in zip(plain, answers, strict=True):
        assert math.dist(turned.transform(*before.estimate.pose[:2]), after.estimate.pose[:2]) < 0.35


def test_same_input_gives_the_same_bytes():
    measurements, _ = drive(seconds=5)
    one, two = (digest(radio_updates(BayesGrid(world()), world(), measurements, prior(START))) for _ in range(2))
    assert one == two


def test_an_absurd_range_is_doubted_and_moves_the_belief_little():
    measurements, truth = drive(outlier_at=150)
    update = radio_updates(BayesGrid(world()), world(), measurements, prior(START))[29]
    assert update.fates[0].decision is Decision.DOWNWEIGHTED
    assert update.fates[0].innovation == pytest.approx(30.0, abs=1.0)
    assert math.dist(update.estimate.pose[:2], truth[29][:2]) < 0.4


def test_motion_below_a_cell_is_not_lost():
    """Creeping 2 cm between far readings without information: the belief arrives where odometry does."""
    place, measurements = world(), []
    for k in range(1, 101):
        reading = Ranges(k * SECOND, "uwb", k, (RangeReading("a", 5.0, 1e6),))
        measurements += [Odometry(k * SECOND, "w", k, (k - 1) * SECOND, 0.02, 0.0), reading]
    start = Prior(0, Pose(2.0, 3.5, 0.0), Covariance.from_std(0.1, 0.1, 0.01))
    last = radio_updates(BayesGrid(place), place, measurements, start)[-1].estimate
    assert last.pose.x == pytest.approx(4.0, abs=0.1)
    assert last.pose.y == pytest.approx(3.5, abs=0.05)


def test_memory_is_bounded_whatever_the_floor():
    sizes = [BayesGrid(world(side_m=side)).start(prior(START), 0).histogram.size for side in (8.0, 80.0)]
    assert max(sizes) < 1.2 * 1600 * 24
    assert max(sizes) < 1.2 * min(sizes)


def test_kernels_keep_all_probability_and_the_mean_and_variance():
    mean, variance = np.array([3.3, -2.6]), np.array([0.5, 2.0])
    kernel = floor_kernel(mean, variance, 41)
    assert np.allclose(kernel.sum(axis=1), 1.0)
    away = np.arange(41) - 20.0
    middle = kernel[:, :, 20]
    assert np.allclose(middle @ away, mean, atol=1e-6)
    # Sharing between two cells adds a sixth when the motion is spread over many, less when it is not.
    assert np.allclose(middle @ away**2 - mean**2, variance + 1.0 / 6.0, atol=0.01)
    turned = turn_kernel(23.5, 0.3, 24)
    assert np.allclose(turned.sum(axis=0), 1.0)
    assert turned[:, 0].argmax() in (23, 0)


def test_what_leaves_the_floor_stays_at_its_edge():
    kernel = floor_kernel(np.array([500.0]), np.array([1.0]), 10)
    assert np.allclose(kernel.sum(axis=1), 1.0)


@pytest.mark.parametrize("options", [{"cells": 1}, {"headings": 1}, {"outlier_share": 0.0}, {"max_correlated": 0.9}])
def test_impossible_options_are_refused(options):
    with pytest.raises(ParameterError, match="bayes_grid"):
        BayesGrid(world(), **options)


def test_particles_are_the_cells_with_their_probabilities():
    grid, place = BayesGrid(world()), world()
    state = grid.start(prior(START), 0)
    shown = grid.particles(state)
    assert shown.weights.sum() == pytest.approx(1.0)
    assert shown.weights @ shown.positions == pytest.approx(state.pose[:2], abs=1e-9)
    bounds = place.bounds
    assert (shown.positions >= (bounds.x_min, bounds.y_min)).all()
    assert (shown.positions <= (bounds.x_max, bounds.y_max)).all()
    assert len(np.unique(shown.positions, axis=0)) == state.histogram[0].size
