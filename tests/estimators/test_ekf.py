"""The extended Kalman filter against filterpy, against the exact Kalman filter, and against a turned world."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from estimators.ekf import Ekf
from fusion import (
    Covariance,
    Decision,
    Odometry,
    ParameterError,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    final,
    track,
    wrap_angle,
)
from fusion.fates import chi_square_gate
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import prior
from tests.worlds import PLACES, PLAIN_NOISE, START, ranged_world


def world(noise=PLAIN_NOISE, places=PLACES, **ranging):
    return ranged_world(places, ranging=ranging, robot={"noise": noise})


def drive(places=PLACES, turned=Pose(0.0, 0.0, 0.0), seconds=20, seed=3, bias=None, outlier_at=None):
    """A circle with noisy odometry at 10 Hz and one range a tenth of a second, anchors in turn."""
    random = np.random.default_rng(seed)
    pose, measurements, truth = START, [], []
    for k in range(1, seconds * 10 + 1):
        distance, turn = 0.05, 0.015
        middle = pose.heading + turn / 2
        pose = Pose(pose.x + distance * math.cos(middle), pose.y + distance * math.sin(middle), pose.heading + turn)
        t = k * SECOND // 10
        noisy = (distance + random.normal(0, 0.003), turn + random.normal(0, 0.003))
        measurements.append(Odometry(t, "wheels", k, t - SECOND // 10, *noisy))
        name = sorted(places)[k % len(places)]
        x, y = turned.transform(pose.x, pose.y)
        error = random.normal(0, 0.2) + (bias or {}).get(name, 0.0) + (50.0 if k == outlier_at else 0.0)
        far = math.hypot(x - places[name][0], y - places[name][1]) + error
        measurements.append(Ranges(t, "uwb", k, (RangeReading(name, far),)))
        truth.append((x, y))
    return measurements, np.array(truth)


def positions(updates):
    return np.array([u.estimate.pose[:2] for u in updates if isinstance(u.measurement, Ranges)])


def test_plain_filter_equals_filterpy_to_1e_9():
    filterpy_kalman = pytest.importorskip("filterpy.kalman")
    place = world()
    measurements, _ = drive()
    reference = filterpy_kalman.ExtendedKalmanFilter(dim_x=3, dim_z=1)
    reference.x = np.array([4.0, 1.0, 0.2])
    reference.P = np.diag([0.09, 0.09, 0.04])
    ours = track(Ekf(place, gate_probability=1.0), place, measurements, prior())
    for update in ours:
        if isinstance(update.measurement, Odometry):
            filterpy_predict(reference, update.measurement, place.robot.noise)
        else:
            filterpy_update(reference, update.measurement.readings[0], place)
        wrapped = (*reference.x[:2], wrap_angle(reference.x[2]))
        assert np.allclose(update.estimate.pose, wrapped, rtol=0, atol=1e-9)
        assert np.allclose(update.estimate.covariance.matrix, reference.P, rtol=0, atol=1e-9)


def filterpy_predict(reference, odometry, noise):
    """The same motion model, written out as matrices."""
    d, w = odometry.distance_m, odometry.turn_rad
    middle = reference.x[2] + w / 2
    c, s = math.cos(middle), math.sin(middle)
    jacobian = np.array([[1, 0, -d * s], [0, 1, d * c], [0, 0, 1]])
    noise_jacobian = np.array([[c, -s, -d * s / 2], [s, c, d * c / 2], [0, 0, 1]])
    forward = noise.distance_std_per_sqrt_m**2 * abs(d) + noise.distance_std_per_sqrt_s**2 * 0.1
    side = noise.side_std_per_sqrt_m**2 * abs(d)
    turn = (
        noise.turn_std_per_sqrt_rad**2 * abs(w)
        + noise.turn_std_per_sqrt_m**2 * abs(d)
        + noise.turn_std_per_sqrt_s**2 * 0.1
    )
    reference.x = reference.x + np.array([d * c, d * s, w])
    q = noise_jacobian @ np.diag([forward, side, turn]) @ noise_jacobian.T
    reference.P = jacobian @ reference.P @ jacobian.T + q


def filterpy_update(reference, reading, place):
    anchor = place.anchor(reading.anchor)

    def expected(x):
        return np.array([math.hypot(x[0] - anchor.x, x[1] - anchor.y)])

    def jacobian(x):
        d = expected(x)[0]
        return np.array([[(x[0] - anchor.x) / d, (x[1] - anchor.y) / d, 0.0]])

    reference.update(np.array([reading.range_m]), jacobian, expected, R=np.array([[0.04]]))


def test_filter_on_a_linear_problem_is_the_kalman_filter():
    """Driving straight at an anchor on the x axis, the range is linear in x: compare with the scalar Kalman filter."""
    places = {"a": (1000.0, 0.0), "b": (0.0, 900.0), "c": (-500.0, -500.0)}
    noise = {**PLAIN_NOISE, "turn_std_per_sqrt_m": 0.0, "turn_std_per_sqrt_s": 0.0, "side_std_per_sqrt_m": 0.0}
    place = world(noise, places)
    start = Prior(0, Pose(0.0, 0.0, 0.0), Covariance(0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    mean, variance, measurements, expected = 0.0, 0.5, [], []
    for k in range(1, 40):
        t = k * SECOND
        reading = 1000.0 - 0.1 * k + 0.3 * math.sin(k)
        measurements += [Odometry(t, "w", k, t - SECOND, 0.1, 0.0), Ranges(t, "r", k, (RangeReading("a", reading),))]
        mean, variance = mean + 0.1, variance + 0.02**2 * 0.1 + 0.002**2
        gain = variance / (variance + 0.04)
        mean, variance = mean + gain * (1000.0 - reading - mean), (1.0 - gain) * variance
        expected.append((mean, variance))
    updates = [u for u in track(Ekf(place, gate_probability=1.0), place, measurements, start) if u.fates]
    got = [(u.estimate.pose.x, u.estimate.covariance.xx) for u in updates]
    assert np.allclose(got, expected, rtol=0, atol=1e-9)


def test_turning_and_shifting_the_world_turns_and_shifts_the_answer():
    turned = Pose(-3.0, 5.0, 2.2)
    moved_places = {name: turned.transform(*place) for name, place in PLACES.items()}
    measurements, _ = drive()
    plain = list(track(Ekf(world()), world(), measurements, prior()))
    place = world(places=moved_places)
    rotated_prior = Prior(0, turned.compose(Pose(4.0, 1.0, 0.2)), Covariance.from_std(0.3, 0.3, 0.2))
    moved = list(track(Ekf(place), place, measurements, rotated_prior))
    wanted = np.array([turned.transform(x, y) for x, y in positions(plain)])
    assert np.allclose(positions(moved), wanted, rtol=0, atol=1e-9)


def test_reading_beyond_the_gate_is_refused_and_changes_nothing():
    measurements, _ = drive(outlier_at=100)
    place = world()
    updates = list(track(Ekf(place), place, measurements, prior()))
    index = next(i for i, u in enumerate(updates) if u.fates and u.fates[0].decision is Decision.REJECTED)
    assert updates[index].fates[0].innovation == pytest.approx(50.0, abs=1.0)
    assert updates[index].estimate.pose == pytest.approx(updates[index - 1].estimate.pose, abs=1e-12)


def test_anchor_biases_are_found_and_taken_off():
    """Anchors that read 0.5 m long or short: with bias states the error shrinks and stays honest."""
    bias = {"a": 0.5, "b": -0.4, "c": 0.3, "d": 0.5}
    measurements, truth = drive(seconds=120, bias=bias)
    place = world(bias_std_m=0.5)
    filters = [Ekf(place, estimate_range_bias=on, range_bias_length_m=1e6) for on in (False, True)]
    plain, aware = (positions(final(track(one, place, measurements, prior()))) for one in filters)
    rmse = [float(np.sqrt(np.mean(np.sum((p - truth) ** 2, axis=1)[300:]))) for p in (plain, aware)]
    assert rmse[1] < 0.7 * rmse[0]


def test_unknown_heading_is_found_by_driving():
    measurements, truth = drive(seconds=60)
    place = world()
    updates = list(track(Ekf(place), place, measurements, prior(heading_known=False)))
    assert not updates[0].estimate.heading_known
    assert updates[-1].estimate.heading_known
    assert np.hypot(*(positions(updates)[-1] - truth[-1])) < 0.3


@pytest.mark.parametrize("probability", [0.5, 0.95, 0.999])
def test_gate_is_the_chi_square_quantile(probability):
    assert chi_square_gate(probability) == pytest.approx(chi2.ppf(probability, 1), rel=1e-9)


@pytest.mark.parametrize(
    "options",
    [
        {"gate_probability": 0.0},
        {"gate_probability": 1.5},
        {"range_bias_length_m": 0.0},
        {"max_correlated": 0.9},
        {"max_correlated": math.nan},
        {"max_correlated": math.inf},
    ],
)
def test_impossible_options_are_refused(options):
    with pytest.raises(ParameterError, match="ekf"):
        Ekf(world(), **options)


def test_common_scale_error_of_all_ranges_is_found():
    """Ranges 7 % long, as a real set of radios was: the scale state finds it, and the track comes back."""
    measurements, truth = drive(seconds=120)
    stretched = [
        replace(m, readings=tuple(r._replace(range_m=1.07 * r.range_m) for r in m.readings))
        if isinstance(m, Ranges)
        else m
        for m in measurements
    ]
    errors = []
    for scale_std in (0.0, 0.05):
        place = world(scale_std=scale_std)
        track_ = positions(final(track(Ekf(place), place, stretched, prior())))
        errors.append(float(np.sqrt(np.mean(np.sum((track_ - truth) ** 2, axis=1)[300:]))))
    assert errors[1] < 0.5 * errors[0]
