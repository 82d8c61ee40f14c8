"""Motion pre-integrated may be cut and joined anywhere, and its derivatives are those of what it stands for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion import Covariance, Increment, Pose, compose, move
from tests.fusion.streams import SECOND, integrated, numbers, odometry, steps


def close(motion):
    return pytest.approx(numbers(motion), rel=1e-9, abs=1e-10)


@given(steps(), st.integers(0, 25))
def test_motion_cut_anywhere_and_joined_is_the_whole(odometries, cut):
    first, second = odometries[:cut], odometries[cut:]
    before = integrated(first)
    joined_again = before.then(integrated(second, before.time_ns))
    assert numbers(joined_again) == close(integrated(odometries))


@given(steps())
def test_motion_cut_everywhere_and_joined_is_the_whole(odometries):
    motion = Increment()
    for step in odometries:
        motion = motion.then(integrated([step]))
    assert numbers(motion) == close(integrated(odometries))


@given(steps(max_size=8), steps(max_size=8), steps(max_size=8))
def test_joining_is_associative(one, two, three):
    a, b, c = map(integrated, (one, two, three))
    assert numbers(a.then(b).then(c)) == close(a.then(b.then(c)))


@given(steps())
def test_no_motion_before_or_after_changes_nothing(odometries):
    motion = integrated(odometries)
    assert Increment().then(motion) == motion
    assert motion.then(Increment(time_ns=motion.time_ns)) == motion


@given(steps(max_size=8), steps(max_size=8))
def test_pose_moved_by_joined_motion_is_the_pose_moved_twice(one, two):
    a, b = integrated(one), integrated(two)
    start = Pose(1.0, 2.0, 0.7), Covariance(0.1, 0.02, 0.01, 0.2, -0.01, 0.05)
    once, twice = compose(*start, a.then(b)), compose(*compose(*start, a), b)
    assert once[0][:2] == pytest.approx(twice[0][:2], abs=1e-10)
    assert math.remainder(once[0].heading - twice[0].heading, math.tau) == pytest.approx(0.0, abs=1e-10)
    assert once[1] == pytest.approx(twice[1], rel=1e-9, abs=1e-10)


ERRORS = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.02, 0.02))


@given(steps(max_size=10), st.floats(-3.0, 3.0), ERRORS)
def test_derivatives_of_a_move_are_those_of_finite_differences(odometries, heading, errors):
    """By the distance error, the turn error and the turn bias, and by the heading, of which no turn depends."""
    motion, step = integrated(odometries), 1e-6
    moved = move(heading, motion, *errors)
    rows = (
        (-moved.dy, *moved.x_by_errors),
        (moved.dx, *moved.y_by_errors),
        (0.0, *moved.turn_by_errors),
    )
    analytic = np.array(rows)
    numeric = np.empty((3, 4))
    for column in range(4):
        ahead, behind = (np.array([heading, *errors]) + sign * step * np.eye(4)[column] for sign in (1.0, -1.0))
        numeric[:, column] = np.subtract(
            move(*ahead[:1], motion, *ahead[1:])[:3], move(*behind[:1], motion, *behind[1:])[:3]
        )
    assert np.allclose(analytic, numeric / (2.0 * step), rtol=1e-6, atol=1e-6)


@given(steps(max_size=10), st.floats(-3.0, 3.0), ERRORS)
def test_noise_of_a_move_is_that_of_the_motion_turned_into_the_map(odometries, heading, errors):
    motion = integrated(odometries)
    c, s = math.cos(heading), math.sin(heading)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    expected = rotation @ np.array(motion.covariance.matrix) @ rotation.T
    assert np.allclose(move(heading, motion, *errors).noise.matrix, expected, rtol=1e-9, atol=1e-12)


@given(steps(max_size=10), st.floats(-3.0, 3.0))
def test_move_without_errors_is_the_pose_composed(odometries, heading):
    motion = integrated(odometries)
    moved, (pose, noise) = move(heading, motion), compose(Pose(0.0, 0.0, heading), Covariance(*[0.0] * 6), motion)
    assert (moved.dx, moved.dy) == pytest.approx(pose[:2], abs=1e-12)
    assert math.remainder(heading + moved.turn - pose.heading, math.tau) == pytest.approx(0.0, abs=1e-12)
    assert moved.noise == pytest.approx(noise, abs=1e-12)


@given(steps(max_size=10), ERRORS, st.floats(0.0, 1.0))
def test_move_with_errors_is_the_motion_measured_without_them_to_first_order(odometries, errors, share):
    """The increments as true wheels would give them, integrated: what is left out is of second order in the turn."""
    distance_error, turn_error, turn_bias = (share * error for error in errors)
    corrected = [
        replace(
            o,
            distance_m=o.distance_m * (1.0 + distance_error),
            turn_rad=o.turn_rad * (1.0 + turn_error) + turn_bias * (o.time_ns - o.from_ns) / SECOND,
        )
        for o in odometries
    ]
    motion, truth = integrated(odometries), integrated(corrected)
    moved = move(0.0, motion, distance_error, turn_error, turn_bias)
    turned = sum(abs(o.turn_rad) for o in odometries) * abs(turn_error) + motion.duration_s * abs(turn_bias)
    assert moved.turn == pytest.approx(truth.heading, abs=1e-9)
    assert math.hypot(moved.dx - truth.x, moved.dy - truth.y) <= 0.6 * turned**2 * truth.path_m + 1e-9


def test_errors_of_many_robots_correct_a_motion_as_those_of_each():
    motion = integrated([odometry(k, 0.3, 0.1) for k in range(1, 30)])
    errors = np.random.default_rng(1).normal(0.0, 0.02, (3, 5))
    together = np.array(motion.corrected(*errors))
    assert np.array_equal(together.T, [motion.corrected(*one) for one in errors.T])
