"""Readings taken one at a time are Kalman's equations, however many."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion.plain_covariance import scaled_gain, shared_with, with_states, without


def kalman(mean, covariance, rows, noise, innovation):
    """The joint update by all readings (Bar-Shalom, Li & Kirubarajan 2001, section 5.2)."""
    gain = covariance @ rows.T @ np.linalg.inv(rows @ covariance @ rows.T + noise)
    return mean + gain @ innovation, covariance - gain @ rows @ covariance


@given(st.integers(0, 1000), st.integers(1, 12), st.integers(3, 9))
def test_readings_one_at_a_time_are_the_joint_update(seed, count, size):
    chance = np.random.default_rng(seed)
    root = chance.normal(size=(size, size))
    covariance, seen = root @ root.T + np.eye(size), chance.normal(size=(count, size))
    variances, innovations = chance.uniform(0.1, 2.0, count), chance.normal(size=count)
    rows, mean, gains = covariance.tolist(), [0.0] * size, []
    for row, variance, innovation in zip(seen.tolist(), variances.tolist(), innovations.tolist(), strict=True):
        jacobian = dict(enumerate(row))
        remaining = innovation - sum(by * mean[i] for i, by in jacobian.items())
        gain, step = scaled_gain(shared_with(rows, jacobian), jacobian, gains, variance, remaining)
        gains.append(gain)
        mean = [m + step * g for m, g in zip(mean, gain, strict=True)]
    expected_mean, expected = kalman(np.zeros(size), covariance, seen, np.diag(variances), innovations)
    after = without(rows, gains)
    assert np.array(mean) == pytest.approx(expected_mean, abs=1e-9)
    assert np.array(after) == pytest.approx(expected, abs=1e-9)
    assert after == [list(column) for column in zip(*after, strict=True)]
    assert rows == covariance.tolist()


def test_further_states_are_independent_of_all_others():
    mean, rows = with_states([1.0], [[2.0]], [3.0, 4.0])
    assert mean == [1.0, 0.0, 0.0]
    assert rows == [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]]
    assert with_states(mean, rows, []) == (mean, rows)
