"""Alignment in closed form, against figures of the reference runs."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.metrics.alignment import align
from benchmarks.metrics.score import errors, metrics
from fusion import ParameterError


def rmse(instants, answers):
    return metrics(errors(instants, answers))["pos_rmse"]


def test_reference_run_is_aligned_as_worked_out(oracle_a):
    instants, answers = oracle_a
    moved = align(instants, answers, "se2")
    assert rmse(instants, moved.answers) == pytest.approx(0.0500046550103, rel=1e-9)
    x, y, yaw = moved.map_from_estimate
    assert (x, y) == pytest.approx((-0.300007557257, 0.100176761555), rel=1e-9)
    assert math.degrees(yaw) == pytest.approx(-0.00413530641934, rel=1e-9)
    assert rmse(instants, align(instants, answers, "origin").answers) == pytest.approx(0.0707771960599, rel=1e-9)


def test_straight_corridor_is_alignable_and_the_raw_error_stays_the_headline(oracle_c):
    instants, answers = oracle_c
    moved = align(instants, answers, "se2")
    assert rmse(instants, answers) == pytest.approx(4.21257460974, rel=1e-9)
    assert rmse(instants, moved.answers) == pytest.approx(0.0282261465065, rel=1e-9)
    assert math.degrees(moved.map_from_estimate.heading) == pytest.approx(-8.00264155988, rel=1e-9)
    assert rmse(instants, align(instants, answers, "origin").answers) == pytest.approx(0.0296252832952, rel=1e-9)


@settings(derandomize=True, max_examples=50)
@given(st.floats(-3.1, 3.1), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.sampled_from(["se2", "origin"]))
def test_alignment_undoes_any_move(instants_of, answers_of, yaw, shift_x, shift_y, how):
    t = np.arange(20.0)
    x, y, heading = np.cos(0.3 * t), t, 0.1 * t
    cos, sin = math.cos(yaw), math.sin(yaw)
    said = answers_of(cos * x - sin * y + shift_x, sin * x + cos * y + shift_y, heading + yaw)
    instants = instants_of(t, x, y, heading)
    measured = errors(instants, align(instants, said, how).answers)
    np.testing.assert_allclose(measured.position, 0.0, atol=1e-9)
    np.testing.assert_allclose(measured.heading, 0.0, atol=1e-9)


@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_run_that_stood_still_is_not_alignable(instants_of, answers_of, noise_m):
    n = 100
    zero = np.zeros(n)
    said = 3.0 + noise_m * np.random.default_rng(0).normal(size=(2, n))
    assert align(instants_of(0.1 * np.arange(n), zero + 1.7, zero, zero), answers_of(*said, zero), "se2") is None


def test_without_headings_or_answers_there_is_nothing_to_align(oracle_a):
    instants, answers = oracle_a
    silent = answers._replace(valid=np.zeros(1000, dtype=bool))
    assert align(instants, answers._replace(heading=np.full(1000, np.nan)), "origin") is None
    assert align(instants, silent, "origin") is None
    assert align(instants, silent, "se2") is None


def test_consistency_is_not_judged_after_alignment(oracle_a):
    instants, answers = oracle_a
    assert math.isnan(metrics(errors(instants, align(instants, answers, "se2").answers))["anees"])


def test_unknown_alignment_is_refused(oracle_a):
    with pytest.raises(ParameterError, match="did you mean 'se2'"):
        align(*oracle_a, "se3")
