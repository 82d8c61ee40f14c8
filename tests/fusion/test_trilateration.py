"""Position fixes from distances: exact ones, collinear anchors, the covariance against the scatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import WorldError
from fusion.trilateration import closed_form, least_squares, trilaterate


@given(st.floats(-20, 20), st.floats(-20, 20))
@settings(derandomize=True)
def test_trilateration_finds_the_place_from_exact_distances(x, y):
    anchors = np.array([[0.0, 0.0], [10.0, 1.0], [3.0, 8.0], [12.0, 9.0]])
    distances = np.hypot(*(anchors - (x, y)).T)
    assert closed_form(anchors[:3], distances[:3]) == pytest.approx((x, y), abs=1e-7)
    assert least_squares(anchors, distances, np.ones(4)) == pytest.approx((x, y), abs=1e-5)
    fix = trilaterate(anchors[:3], distances[:3], np.ones(3))
    assert (fix.x, fix.y) == closed_form(anchors[:3], distances[:3])


def test_collinear_anchors_are_refused_by_the_closed_form():
    with pytest.raises(WorldError, match="one line"):
        closed_form(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), np.ones(3))


@pytest.mark.parametrize("count", [3, 4])
def test_covariance_of_a_fix_is_that_of_its_scatter(count):
    """Outside the triangle the closed form errs more than least squares would; 4000 draws show it."""
    anchors = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [5.0, 6.0]])[:count]
    place, stds = np.array([6.0, 5.0]), np.full(count, 0.02)
    exact = np.hypot(*(anchors - place).T)
    chance = np.random.default_rng(5)
    fixes = np.array([trilaterate(anchors, exact + chance.normal(0, 0.02, count), stds)[:2] for _ in range(4000)])
    claimed = trilaterate(anchors, exact, stds)
    assert np.cov(fixes.T) == pytest.approx(np.array([[claimed.xx, claimed.xy], [claimed.xy, claimed.yy]]), rel=0.1)
