"""Meeting at the estimate's stamps: weights, gaps, and no error from stamps that differ."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.matching import meet
from benchmarks.metrics.score import errors, metrics
from fusion.quantiles import Ordered, mean, quantile
from logs.truth import TruthTrack


def stamps(time_s):
    return np.rint(np.asarray(time_s, dtype=float) * 1e9).astype(np.int64)


def truth_of(time_s, x):
    none = np.zeros(len(time_s))
    return TruthTrack(stamps(time_s), np.asarray(x, dtype=float), none, none)


def track_of(time_s, x):
    none = np.zeros(len(time_s))
    return Track.of_poses(stamps(time_s), np.asarray(x, float), none, none)


def test_stamps_that_differ_by_24_ms_make_no_error():
    truth_s, said_s = np.arange(0.0, 60.0, 0.05), 0.024 + np.arange(0.0, 59.0, 0.1)
    met = meet(truth_of(truth_s, truth_s), track_of(said_s, said_s))
    assert metrics(errors(met.instants, met.answers, met.weight))["pos_max"] < 1e-9


def test_each_answer_stands_for_half_of_the_gaps_beside_it_and_long_gaps_are_cut():
    truth_s = np.arange(0.0, 10.01, 0.1)
    met = meet(truth_of(truth_s, truth_s), track_of([1.0, 1.2, 1.6, 5.0], [1.0, 1.2, 1.6, 6.0]), gap_s=0.5)
    assert met.weight.tolist() == pytest.approx([0.1, 0.3, 0.2 + 0.25, 0.25])
    assert met.availability == pytest.approx(1.1 / 10.0)
    scores = metrics(errors(met.instants, met.answers, met.weight))
    assert scores["pos_mean"] == pytest.approx(1.0 * 0.25 / 1.1)
    assert scores["pos_rmse"] == pytest.approx(np.sqrt(0.25 / 1.1))


def test_answers_outside_the_truth_or_inside_its_gaps_are_left_out():
    truth = truth_of([0.0, 0.1, 0.2, 3.0, 3.1], [0.0, 1.0, 2.0, 30.0, 31.0])
    met = meet(truth, track_of([-1.0, 0.1, 0.15, 1.0, 3.0, 4.0], np.zeros(6)))
    assert (met.instants.time_ns / 1e9).tolist() == pytest.approx([0.1, 0.15, 3.0])
    assert met.instants.x.tolist() == pytest.approx([1.0, 1.5, 30.0])


def test_of_two_answers_with_one_stamp_the_last_counts_and_order_of_arrival_is_no_matter():
    truth = truth_of(np.arange(0.0, 3.0, 0.1), np.zeros(30))
    met = meet(truth, track_of([1.0, 2.0, 1.0], [5.0, 6.0, 7.0]))
    assert met.answers.x.tolist() == [7.0, 6.0]


def test_nothing_to_meet_leaves_nothing():
    truth = truth_of([0.0], [0.0])
    assert len(meet(truth, track_of([0.0], [1.0])).answers.x) == 0
    assert len(meet(truth_of([0.0, 0.1], [0.0, 0.0]), track_of([5.0], [1.0])).answers.x) == 0


VALUES = st.lists(st.floats(0.0, 100.0), min_size=1, max_size=30)


@settings(derandomize=True, max_examples=60)
@given(VALUES, st.floats(0.0, 1.0), st.floats(0.1, 10.0))
def test_equal_weights_change_nothing(values, share, weight):
    values = np.array(values)
    weights = np.full(len(values), weight)
    assert quantile(values, share, weights) == pytest.approx(quantile(values, share), rel=1e-6, abs=1e-9)
    assert mean(values, weights) == pytest.approx(mean(values), rel=1e-9, abs=1e-12)


def test_weighted_quantile_stays_between_its_neighbours_and_meets_infinity():
    values, weights = np.array([1.0, 2.0, 3.0, np.inf]), np.array([1.0, 1.0, 6.0, 1.0])
    found = [Ordered.of(values, weights).quantile(share) for share in (0.0, 0.5, 0.6, 1.0)]
    assert found[0] == 1.0
    assert 2.0 < found[1] < 3.0
    assert found[2:] == [np.inf, np.inf]


def test_one_answer_alone_stands_for_no_time_and_is_left_out():
    truth = truth_of(np.arange(0.0, 3.0, 0.1), np.zeros(30))
    met = meet(truth, track_of([1.0, 9.0], [5.0, 6.0]))
    assert met.availability == 0.0
    scores = metrics(errors(met.instants, met.answers, met.weight))
    assert scores["n"] == 0.0
    assert all(np.isnan(scores[name]) for name in ("pos_mean", "pos_rmse", "pos_p75", "pos_cdf_1m", "bias_x"))
