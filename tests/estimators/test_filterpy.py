"""filterpy's filters behind our contract, against our own filter, the exact Kalman filter, and each other."""

import math

import numpy as np
import pytest

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
    build,
    digest,
    track,
)
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import prior, radio_updates
from tests.worlds import PLACES, PLAIN_NOISE, START, circle, ranged_world

pytest.importorskip("filterpy.kalman")
ARM = (0.1, 0.05)
BOTH = pytest.mark.parametrize("name", ["filterpy_ekf", "filterpy_ukf"])


def world(noise=PLAIN_NOISE, places=PLACES, arm=ARM, bias_std_m=0.1):
    return ranged_world(places, ranging={"bias_std_m": bias_std_m}, robot={"noise": noise, "antenna_m": [*arm, 0.0]})


def drive(**options):
    return circle(arm=ARM, **options)


def test_extended_filter_equals_ours_to_1e_9():
    place, (measurements, _) = world(bias_std_m=0.0), drive(outlier_at=100)
    ours = track(Ekf(place), place, measurements, prior())
    theirs = track(build("filterpy_ekf", place), place, measurements, prior())
    for own, other in zip(ours, theirs, strict=True):
        assert np.allclose(own.estimate.pose, other.estimate.pose, rtol=0, atol=1e-9)
        assert np.allclose(own.estimate.covariance, other.estimate.covariance, rtol=0, atol=1e-9)
        for fate, other_fate in zip(own.fates, other.fates, strict=True):
            assert fate[:7] == other_fate[:7]
            assert np.allclose(fate[7:], other_fate[7:], rtol=1e-6, atol=1e-9)


@BOTH
def test_filter_on_a_linear_problem_is_the_kalman_filter(name):
    """Driving straight at an anchor on the x axis, the range is linear in x: compare with the scalar Kalman filter."""
    places = {"a": (1000.0, 0.0), "b": (0.0, 900.0), "c": (-500.0, -500.0)}
    still = {"turn_std_per_sqrt_m": 0.0, "turn_std_per_sqrt_s": 0.0, "side_std_per_sqrt_m": 0.0}
    place = world({**PLAIN_NOISE, **still}, places, (0.0, 0.0))
    start = Prior(0, Pose(0.0, 0.0, 0.0), Covariance(0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    mean, variance, measurements, expected = 0.0, 0.5, [], []
    for k in range(1, 40):
        t, reading = k * SECOND, 1000.0 - 0.1 * k + 0.3 * math.sin(k)
        measurements += [Odometry(t, "w", k, t - SECOND, 0.1, 0.0), Ranges(t, "r", k, (RangeReading("a", reading),))]
        mean, variance = mean + 0.1, variance + 0.02**2 * 0.1 + 0.002**2
        gain = variance / (variance + 0.2**2 + 0.1**2)
        mean, variance = mean + gain * (1000.0 - reading - mean), (1.0 - gain) * variance
        expected.append((mean, variance))
    updates = radio_updates(build(name, place, {"gate_probability": 1.0}), place, measurements, start)
    got = [(u.estimate.pose.x, u.estimate.covariance.xx) for u in updates]
    assert np.allclose(got, expected, rtol=0, atol=1e-9)


@BOTH
def test_noiseless_data_lead_to_the_truth(name):
    measurements, truth = drive(std_m=0.0)
    last = radio_updates(build(name, world()), world(), measurements, prior())[-1].estimate
    assert math.dist(last.pose[:2], truth[-1][:2]) < 0.01


def test_unscented_and_extended_filter_are_close_once_settled():
    measurements, _ = drive()
    runs = (radio_updates(build(n, world()), world(), measurements, prior()) for n in ("filterpy_ekf", "filterpy_ukf"))
    for one, other in list(zip(*runs, strict=True))[10:]:
        assert math.dist(one.estimate.pose[:2], other.estimate.pose[:2]) < 0.02


# Sigma points lie along the map's axes while the spread is the same all around: second order makes a small difference.
@pytest.mark.parametrize(("name", "tolerance"), [("filterpy_ekf", 1e-9), ("filterpy_ukf", 1e-3)])
def test_turning_and_shifting_the_world_turns_and_shifts_the_answer(name, tolerance):
    turned = Pose(-3.0, 5.0, 2.2)
    place = world(places={anchor: turned.transform(*at) for anchor, at in PLACES.items()})
    measurements, _ = drive()
    plain = radio_updates(build(name, world()), world(), measurements, prior())
    moved = radio_updates(build(name, place), place, measurements, prior(turned.compose(START)))
    for before, after in zip(plain, moved, strict=True):
        assert np.allclose(turned.compose(before.estimate.pose), after.estimate.pose, rtol=0, atol=tolerance)


@BOTH
def test_reading_beyond_the_gate_is_refused_and_open_gate_takes_it(name):
    measurements, _ = drive(outlier_at=150)
    gated, open_gate = (
        radio_updates(build(name, world(), {"gate_probability": gate}), world(), measurements, prior())[29]
        for gate in (0.999, 1.0)
    )
    assert gated.fates[0].decision is Decision.REJECTED
    assert gated.fates[0].innovation == pytest.approx(30.0, abs=1.0)
    assert open_gate.fates[0].decision is Decision.USED


@BOTH
def test_unknown_heading_is_found_by_driving(name):
    measurements, truth = drive(seconds=60)
    updates = radio_updates(build(name, world()), world(), measurements, prior(heading_known=False))
    assert not updates[0].estimate.heading_known
    assert updates[-1].estimate.heading_known
    assert math.dist(updates[-1].estimate.pose[:2], truth[-1][:2]) < 0.3


@BOTH
def test_same_input_gives_the_same_bytes(name):
    measurements, _ = drive(seconds=5)
    one, two = (digest(radio_updates(build(name, world()), world(), measurements, prior())) for _ in range(2))
    assert one == two


@BOTH
def test_impossible_gate_is_refused(name):
    with pytest.raises(ParameterError, match="gate_probability"):
        build(name, world(), {"gate_probability": 0.0})
