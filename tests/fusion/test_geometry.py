"""Poses and spreads in the plane against linear algebra."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import BeliefError, Covariance, Pose, wrap_angle

reals = st.floats(-50.0, 50.0)
angles = st.floats(-3.0, 3.0)

factor = st.floats(-10.0, 10.0)


@given(factor, factor, factor)
def test_ellipse_is_that_of_the_eigenvalues(a, b, c):
    root = np.array([[a, 0.0], [b, c]])
    (xx, xy), (_, yy) = matrix = root @ root.T
    major, minor, angle = Covariance(xx, xy, 0.0, yy, 0.0, 0.0).ellipse
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert np.allclose(axes @ np.diag([major**2, minor**2]) @ axes.T, matrix, atol=1e-9)
    assert major >= minor >= 0.0


@given(st.lists(factor, min_size=9, max_size=9), st.floats(1e-6, 1e6))
def test_every_square_of_a_matrix_is_a_covariance_whatever_its_unit(numbers, unit):
    root = unit * np.array(numbers).reshape(3, 3)
    assert Covariance.from_matrix((root @ root.T).tolist()).flaw() == ""


@given(st.lists(st.floats(0.01, 10.0), min_size=3, max_size=3), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_flaw_agrees_with_the_least_eigenvalue_of_the_correlations(stds, correlations):
    xy, xh, yh = correlations
    least = np.linalg.eigvalsh([[1.0, xy, xh], [xy, 1.0, yh], [xh, yh, 1.0]])[0]
    a, b, c = stds
    flaw = Covariance(a * a, xy * a * b, xh * a * c, b * b, yh * b * c, c * c).flaw()
    if abs(least) > 1e-3:
        assert bool(flaw) == (least < 0.0), flaw


def test_what_is_not_known_is_not_judged():
    spoilt = Covariance(1.0, 0.0, 9.0, 1.0, 0.0, -1.0)
    assert "variance of heading is -1" in spoilt.flaw()
    assert spoilt.flaw((True, True, False)) == ""
    assert Covariance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0).flaw() == ""
    assert (
        "x and y have a covariance of 1, and their variances allow 0" in Covariance(0.0, 1.0, 0.0, 1.0, 0.0, 1.0).flaw()
    )


def test_matrix_that_is_not_symmetric_is_refused_but_for_rounding():
    with pytest.raises(BeliefError, match=r"row 1, column 3 is 0\.5, and across the diagonal -0\.5"):
        Covariance.from_matrix([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [-0.5, 0.0, 1.0]])
    rounded = Covariance.from_matrix([[1.0, 0.1, 0.0], [math.nextafter(0.1, 1.0), 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert rounded.xy == 0.1


@given(angles, st.integers(-5, 5))
@settings(derandomize=True)
def test_wrapped_angle_is_the_same_angle(angle, turns):
    wrapped = wrap_angle(angle + turns * math.tau)
    assert -math.pi < wrapped <= math.pi
    assert math.isclose(math.remainder(wrapped - angle, math.tau), 0.0, abs_tol=1e-9)


@given(reals, reals, angles)
@settings(derandomize=True)
def test_pose_composed_with_its_inverse_is_the_origin(x, y, heading):
    pose = Pose(x, y, heading)
    assert pose.compose(pose.inverse()) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
