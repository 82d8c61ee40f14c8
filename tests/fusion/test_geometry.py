"""Poses and spreads in the plane against linear algebra."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fusion import Covariance

factor = st.floats(-10.0, 10.0)


@given(factor, factor, factor)
def test_ellipse_is_that_of_the_eigenvalues(a, b, c):
    root = np.array([[a, 0.0], [b, c]])
    (xx, xy), (_, yy) = matrix = root @ root.T
    major, minor, angle = Covariance(xx, xy, 0.0, yy, 0.0, 0.0).ellipse
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert np.allclose(axes @ np.diag([major**2, minor**2]) @ axes.T, matrix, atol=1e-9)
    assert major >= minor >= 0.0
