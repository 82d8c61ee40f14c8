"""One run: blocks as long as the errors are alike, and a label that states how far the verdict reaches."""

import math

import numpy as np
import pytest

from benchmarks.statistics.block_bootstrap import block_length, resampled, within_run
from fusion import ParameterError


def correlated(correlation, count, seed):
    """A first-order autoregressive series (count,) of variance 1."""
    noise = np.random.default_rng(seed).normal(size=count) * math.sqrt(1.0 - correlation**2)
    series = np.empty(count)
    value = 0.0
    for i, shock in enumerate(noise):
        series[i] = value = correlation * value + shock
    return series


def errors_of(scale, seed=0, count=3000):
    return {"ekf": np.abs(correlated(0.9, count, seed)), "particle": scale * np.abs(correlated(0.9, count, seed + 100))}


@pytest.mark.parametrize("correlation", [0.5, 0.8])
def test_block_length_is_that_of_an_autoregressive_series(correlation):
    """There G / g(0) is 2 rho / (1 - rho^2), so b = (2 rho / (1 - rho^2))^(2/3) n^(1/3). Mean of 20 series."""
    count = 5000
    expected = (2.0 * correlation / (1.0 - correlation**2)) ** (2.0 / 3.0) * count ** (1.0 / 3.0)
    found = np.mean([block_length(correlated(correlation, count, seed)) for seed in range(20)])
    assert found == pytest.approx(expected, rel=0.1)


def test_blocks_of_white_noise_are_short_and_of_a_constant_single():
    assert block_length(correlated(0.0, 3000, 1)) < 6.0
    assert block_length(np.ones(100)) == 1.0


def test_block_length_has_a_ceiling():
    assert block_length(np.arange(100.0)) <= math.ceil(min(30.0, 100.0 / 3.0))


def test_blocks_are_neighbours_of_the_mean_length_asked_for():
    (drawn,) = resampled(np.random.default_rng(1), 200_000, 20.0, 1)
    begins = np.count_nonzero((np.diff(drawn) != 1) & (np.diff(drawn) != 1 - 200_000)) + 1
    assert 200_000 / begins == pytest.approx(20.0, rel=0.05)
    assert drawn.min() >= 0
    assert drawn.max() < 200_000


def test_clear_difference_is_found_and_labelled():
    verdict = within_run("ekf", "particle", errors_of(2.0), "pos_p75", 0.75)
    assert verdict.winner == "ekf"
    assert verdict.low < verdict.ratio < verdict.high < 1.0
    assert verdict.sentence.startswith("within this run, ekf beats particle by ")
    assert verdict.sentence.endswith("other runs may differ)")


def test_estimators_alike_are_inconclusive():
    verdict = within_run("ekf", "particle", errors_of(1.0), "pos_p75", 0.75)
    assert verdict.winner is None
    assert verdict.sentence.startswith("within this run, inconclusive between ekf and particle on pos_p75: ratio ")


def test_interval_is_wider_than_one_that_takes_instants_for_samples():
    errors = errors_of(1.0)
    verdict = within_run("ekf", "particle", errors, "pos_p75", 0.75)
    random = np.random.default_rng(2)
    naive = []
    for _ in range(200):
        chosen = random.integers(0, 3000, 3000)
        naive.append(np.log(np.quantile(errors["ekf"][chosen], 0.75) / np.quantile(errors["particle"][chosen], 0.75)))
    assert math.log(verdict.high / verdict.low) > 2.0 * (np.quantile(naive, 0.975) - np.quantile(naive, 0.025))


def test_same_seed_gives_the_same_verdict():
    assert within_run("ekf", "particle", errors_of(1.2), "pos_p75", 0.75, seed=3) == within_run(
        "ekf", "particle", errors_of(1.2), "pos_p75", 0.75, seed=3
    )


def test_estimator_that_died_early_is_beaten():
    errors = errors_of(1.0)
    errors["particle"][500:] = math.inf
    verdict = within_run("ekf", "particle", errors, "pos_p75", 0.75)
    assert (verdict.winner, verdict.ratio) == ("ekf", 0.0)


def test_series_that_do_not_belong_together_or_are_short_are_refused():
    with pytest.raises(ParameterError, match="give both at the same instants"):
        within_run("a", "b", {"a": np.ones(100), "b": np.ones(99)}, "pos_p75", 0.75)
    with pytest.raises(ParameterError, match="at least 30"):
        within_run("a", "b", {"a": np.ones(9), "b": np.ones(9)}, "pos_p75", 0.75)
