"""The distribution of errors as a picture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.review.cdf import WIDTH, CdfAxes

INF = np.inf
errors = st.lists(st.floats(0.0, 50.0) | st.just(INF), min_size=1, max_size=60).map(np.array)


def test_curve_passes_through_the_shares_of_the_empirical_distribution():
    corners = CdfAxes(2.0, 0.5).curve(np.array([0.5, 1.5, 1.0, 2.0]))
    assert np.allclose(corners[:, 0], np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.0]) * WIDTH / 2.0)
    assert corners[:, 1].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.0]


def test_curve_saturates_at_the_availability_and_runs_on_to_the_edge():
    corners = CdfAxes(2.0, 0.5).curve(np.array([0.5, INF, 1.0, INF, INF]))
    assert corners[-1].tolist() == [WIDTH, 0.4]
    assert corners[-2].tolist() == [pytest.approx(0.5 * WIDTH), 0.4]


def test_errors_beyond_the_edge_count_and_are_not_drawn():
    corners = CdfAxes(1.0, 0.25).curve(np.array([0.5, 3.0]))
    assert corners[-1].tolist() == [WIDTH, 0.5]


@settings(derandomize=True)
@given(errors)
def test_curve_never_falls_and_stays_in_the_picture(own):
    corners = CdfAxes.around([own]).curve(own)
    assert (np.diff(corners, axis=0) >= 0.0).all()
    assert (corners >= 0.0).all()
    assert (corners <= [WIDTH + 1e-9, 1.0]).all()
    assert corners[-1, 1] <= np.isfinite(own).mean()


def test_axes_hold_95_percent_of_the_worst_estimator_in_round_steps():
    assert CdfAxes.around([np.linspace(0.0, 1.0, 101), np.linspace(0.0, 4.0, 101)]) == CdfAxes(4.0, 1.0)
    assert CdfAxes.around([np.full(9, INF)]).error_max_m > 0.0
    assert CdfAxes.around([np.zeros(9)]).error_max_m > 0.0


def test_long_curves_are_drawn_with_few_corners_and_the_same_ends():
    own = np.linspace(0.0, 1.0, 100_000)
    corners = CdfAxes(1.0, 0.25).curve(own)
    assert len(corners) < 1000
    assert corners[-1].tolist() == [WIDTH, 1.0]
