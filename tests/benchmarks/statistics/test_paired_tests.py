"""The tests of significance against figures by hand, against SciPy, and against their own promises."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from benchmarks.statistics.paired_tests import (
    MAX_RUNS,
    detectable_effect,
    friedman_p,
    holm,
    log_ratios,
    mean_interval,
    mid_ranks,
    runs_needed,
    signed_rank,
)

SAMPLES = np.array([-0.31, 0.12, -0.22, -0.05, -0.41, -0.18, 0.03, -0.27])


def test_interval_of_three_samples_is_as_worked_out_by_hand():
    """Mean 2, standard deviation 1, t(2, 0.975) = 4.30265."""
    interval = mean_interval(np.array([1.0, 2.0, 3.0]))
    assert (interval.mean, interval.std) == (2.0, 1.0)
    assert interval.low == pytest.approx(2.0 - 4.302652729696 / math.sqrt(3.0))
    assert interval.high == pytest.approx(2.0 + 4.302652729696 / math.sqrt(3.0))


def test_interval_and_p_are_those_of_scipy():
    interval, peer = mean_interval(SAMPLES, 0.9), stats.ttest_1samp(SAMPLES, 0.0)
    assert interval.p == pytest.approx(peer.pvalue)
    assert (interval.low, interval.high) == pytest.approx(tuple(peer.confidence_interval(0.9)))


def test_one_sample_leaves_everything_possible():
    interval = mean_interval(np.array([0.3]))
    assert (interval.mean, interval.low, interval.high, interval.p) == (0.3, -math.inf, math.inf, 1.0)


def test_samples_that_agree_exactly_are_certain():
    assert mean_interval(np.full(4, 0.5)).p == 0.0
    assert mean_interval(np.zeros(4)).p == 1.0


def test_interval_of_six_mildly_skewed_runs_covers_as_often_as_it_promises():
    """Simulated elsewhere with other draws: 0.950. Three standard errors of this many trials are allowed."""
    random, trials = np.random.default_rng(6), 4000
    shape = (trials, 6)
    interval = mean_interval(random.normal(size=shape) + 0.5 * (random.exponential(size=shape) - 1.0))
    coverage = np.mean((interval.low <= 0.0) & (interval.high >= 0.0))
    assert abs(coverage - 0.950) < 3.0 * math.sqrt(0.95 * 0.05 / trials)


@pytest.mark.parametrize(
    ("runs", "effect"), [(4, 2.08), (6, 1.42), (8, 1.15), (12, 0.89), (20, 0.66), (40, 0.45)], ids=str
)
def test_detectable_effect_is_that_of_the_table(runs, effect):
    assert round(detectable_effect(runs), 2) == effect


def test_nothing_is_detectable_from_one_run():
    assert detectable_effect(1) == math.inf


def test_runs_needed_are_the_first_that_make_an_effect_detectable():
    for effect in (0.3, 0.66, 1.42, 3.0):
        needed = runs_needed(effect)
        assert detectable_effect(needed) <= effect < detectable_effect(needed - 1)


@pytest.mark.parametrize("effect", [0.0, 0.01, math.nan])
def test_no_number_of_runs_settles_no_effect(effect):
    assert detectable_effect(MAX_RUNS) > 0.01
    assert runs_needed(effect) is None


@pytest.mark.parametrize(("runs", "least"), [(4, 0.125), (5, 0.0625), (6, 0.03125), (8, 0.0078125)])
def test_least_p_of_signed_ranks_is_two_in_two_to_the_runs(runs, least):
    assert signed_rank(-np.arange(1.0, runs + 1.0)).p == least


def test_signed_ranks_without_ties_are_those_of_scipy():
    peer = stats.wilcoxon(SAMPLES, method="exact")
    ours = signed_rank(SAMPLES)
    assert ours.p == pytest.approx(peer.pvalue)
    assert ours.sum == 2.0 * 4.0 - 36.0  # the positive ones have ranks 1 and 3


@pytest.mark.parametrize(
    "differences",
    [(1.0, 1.0, -1.0, 2.0, 2.0, 3.0), (math.inf, math.inf, -1.0, 2.0, 0.5), (-math.inf, math.inf, 1.0, 1.0, -3.0, 4.0)],
)
def test_signed_ranks_with_ties_count_all_sign_patterns(differences):
    values = np.array(differences)
    ranks = stats.rankdata(np.abs(values))
    observed = abs(ranks @ np.sign(values))
    patterns = [abs(ranks @ signs) for signs in itertools.product((-1.0, 1.0), repeat=len(values))]
    assert signed_rank(values).p == pytest.approx(np.mean([sum_ >= observed for sum_ in patterns]))


def test_differences_of_zero_count_nothing():
    assert signed_rank(np.zeros(9)) == (0.0, 1.0)
    assert signed_rank(np.append(SAMPLES, [0.0, 0.0])) == signed_rank(SAMPLES)


def test_a_lost_run_is_the_worst_there_can_be():
    first, second = np.array([math.inf, 1.0, math.inf, 2.0]), np.array([1.0, math.inf, math.inf, 1.0])
    assert log_ratios(first, second).tolist() == [math.inf, -math.inf, 0.0, math.log(2.0)]


def test_equal_values_share_the_mean_of_their_ranks():
    values = np.array([3.0, 1.0, 3.0, math.inf, math.inf])
    assert mid_ranks(values).tolist() == stats.rankdata(values).tolist() == [2.5, 1.0, 2.5, 4.5, 4.5]


def test_holm_multiplies_the_least_p_most_and_never_falls():
    assert holm(np.array([0.04, 0.01, 0.03, 0.9])).tolist() == pytest.approx([0.09, 0.04, 0.09, 0.9])
    assert holm(np.array([0.6, 0.7])).tolist() == [1.0, 1.0]
    assert holm(np.array([])).tolist() == []


def test_friedman_is_that_of_scipy_with_and_without_ties():
    scores = np.array(
        [[1.0, 2.0, 3.0], [2.0, 1.0, 4.0], [1.0, 3.0, 3.0], [0.5, 2.5, 2.0], [1.0, 2.0, 2.0], [3.0, 2.0, 5.0]]
    )
    assert friedman_p(scores) == pytest.approx(stats.friedmanchisquare(*scores.T).pvalue)
    assert friedman_p(scores[:2]) == pytest.approx(stats.friedmanchisquare(*scores[:2].T).pvalue)
    assert friedman_p(np.ones((5, 3))) == 1.0


@settings(derandomize=True)
@given(st.lists(st.integers(-20, 20), min_size=1, max_size=9))
def test_turning_all_differences_round_turns_the_sum_and_keeps_p(differences):
    values = np.array(differences, dtype=float)
    ours, turned = signed_rank(values), signed_rank(-values)
    assert turned == (-ours.sum, ours.p)
