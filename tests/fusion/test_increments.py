"""Increments composed: equal to stepping through them, derivatives, noise that no message rate changes."""

import math

import pytest

from fusion import Covariance, Increment, Odometry, OdometryNoise, Pose, compose

SECOND = 1_000_000_000


def steps(count=30):
    return [
        Odometry((k + 1) * 10**8, "w", k, k * 10**8, 0.05 + 0.01 * math.sin(k), 0.1 * math.cos(k)) for k in range(count)
    ]


def test_composing_an_increment_equals_stepping_through_it():
    noise, start = OdometryNoise(), (Pose(1.0, 2.0, 0.7), Covariance(0.1, 0.02, 0.01, 0.2, -0.01, 0.05))
    whole, stepped = Increment(), start
    for odometry in steps():
        whole = whole.extend(odometry, noise)
        stepped = compose(*stepped, Increment().extend(odometry, noise))
    at_once = compose(*start, whole)
    assert at_once[0] == pytest.approx(stepped[0], abs=1e-12)
    assert at_once[1] == pytest.approx(stepped[1], abs=1e-12)


def test_derivatives_of_an_increment_are_those_of_finite_differences():
    noise, small = OdometryNoise(), 1e-6

    def total(bias=0.0, scale=0.0):
        motion = Increment()
        for o in steps():
            motion = motion.extend(
                Odometry(o.time_ns, "w", o.seq, o.from_ns, o.distance_m, o.turn_rad * (1 + scale) + 0.1 * bias), noise
            )
        return motion

    plain = total()
    for by, moved in (
        (("x_by_bias", "y_by_bias"), (total(bias=small), total(bias=-small))),
        (("x_by_scale", "y_by_scale"), (total(scale=small), total(scale=-small))),
    ):
        for name, axis in zip(by, "xy", strict=True):
            numeric = (getattr(moved[0], axis) - getattr(moved[1], axis)) / (2 * small)
            assert getattr(plain, name) == pytest.approx(numeric, abs=1e-6)


@pytest.mark.parametrize("rate", [10, 50])
def test_covariance_of_a_motion_does_not_depend_on_the_message_rate(rate):
    """The same ten seconds in 100 or 500 messages: both must give the closed form for 3 m in 10 s."""
    noise, motion = (
        OdometryNoise(turn_std_per_sqrt_m=0.0, turn_std_per_sqrt_s=0.0, turn_std_per_sqrt_rad=0.0),
        Increment(),
    )
    for k in range(10 * rate):
        motion = motion.extend(Odometry((k + 1) * SECOND // rate, "w", k, k * SECOND // rate, 0.3 / rate, 0.0), noise)
    assert motion.covariance.xx == pytest.approx(
        noise.distance_std_per_sqrt_m**2 * 3.0 + noise.distance_std_per_sqrt_s**2 * 10.0
    )
