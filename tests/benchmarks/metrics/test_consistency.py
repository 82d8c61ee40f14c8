"""Bands, effective sizes and proper scores against tables, closed forms and simulation."""

import math
from functools import partial

import numpy as np
import pytest
from scipy import integrate, stats

from benchmarks.metrics.consistency import CHI_SQUARE_95, distribution_metrics
from benchmarks.metrics.effective_samples import binomial_interval, effective_sizes, mean_chi_square_band, order_shares
from benchmarks.metrics.errors import errors
from benchmarks.metrics.intervals import quantile_intervals
from benchmarks.metrics.proper_scores import _tail, energy_scores, judge
from benchmarks.metrics.score import metrics
from fusion.quantiles import Ordered

BANDS = {
    (1, 1): (0.0010, 5.0239),
    (1, 10): (0.3247, 2.0483),
    (1, 1000): (0.9143, 1.0895),
    (2, 1): (0.0253, 3.6889),
    (2, 20): (0.6108, 1.4835),
    (2, 200): (0.8662, 1.1433),
    (3, 1): (0.0719, 3.1161),
    (3, 50): (0.7866, 1.2387),
    (3, 100): (0.8464, 1.1662),
    (3, 1000): (0.9500, 1.0512),
}


def correlated(r, rho, n):
    """A first-order autoregressive series of variance 1."""
    noise = r.normal(0.0, math.sqrt(1.0 - rho**2), n)
    noise[0] = r.normal()
    for k in range(1, n):
        noise[k] += rho * noise[k - 1]
    return noise


@pytest.mark.parametrize("case", BANDS, ids=str)
def test_band_of_anees_is_that_of_the_tables(case):
    assert mean_chi_square_band(*case) == pytest.approx(BANDS[case], abs=5.1e-5)


def test_gates_are_those_of_the_tables():
    assert pytest.approx((3.841459, 5.991465, 7.814728), abs=5e-7) == tuple(CHI_SQUARE_95[n] for n in (1, 2, 3))


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_effective_size_of_an_autoregressive_series_is_as_in_theory(rho):
    series = correlated(np.random.default_rng(1), rho, 100_000)
    (size,) = effective_sizes(series[None])
    assert size == pytest.approx(100_000 * (1.0 - rho) / (1.0 + rho), rel=0.06)


def test_white_noise_counts_fully_and_never_more():
    r = np.random.default_rng(2)
    white = r.normal(size=100_000)
    sizes = effective_sizes(np.array([white, np.tile([1.0, -1.0], 50_000)]))
    assert 95_000 < sizes[0] <= 100_000
    assert sizes[1] == 100_000


def test_series_that_never_changes_takes_the_size_of_the_first_or_one():
    changing, constant = np.sin(np.arange(50.0)), np.ones(50)
    first, second = effective_sizes(np.array([changing, constant]))
    assert second == first
    assert effective_sizes(constant[None]).tolist() == [1.0]
    assert effective_sizes(np.ones((2, 1))).tolist() == [1.0, 1.0]
    assert np.isnan(effective_sizes(np.ones((2, 0)))).all()


def test_intervals_with_effective_size_hold_what_they_promise(instants_of, answers_of):
    """Correlation time 1 s at 10 Hz: with the plain number of samples both hold in about half of the cases only."""
    r, rho, trials = np.random.default_rng(3), math.exp(-0.1), 300
    p75 = stats.norm.ppf(0.875)
    cover, quantile = 0, 0
    for _ in range(trials):
        error = np.abs(correlated(r, rho, 1500))
        instants = instants_of(0.1 * np.arange(1500), *np.zeros((3, 1500)))
        measured = errors(instants, answers_of(error, *np.zeros((2, 1500))))
        scores = quantile_intervals(measured, Ordered.of(measured.position))
        quantile += scores["pos_p75_low"] <= p75 <= scores["pos_p75_high"]
        hit = error < 1.0
        (size,) = effective_sizes(hit[None].astype(float))
        low, high = binomial_interval(hit.mean(), size)
        cover += low <= 2.0 * stats.norm.cdf(1.0) - 1.0 <= high
    assert 0.91 <= cover / trials <= 0.98
    assert 0.91 <= quantile / trials <= 0.98


def test_binomial_interval_is_wilsons():
    expected = stats.binomtest(81, 100).proportion_ci(method="wilson")
    assert binomial_interval(0.81, 100.0) == pytest.approx((expected.low, expected.high), rel=1e-12)
    assert binomial_interval(1.0, 10.0)[1] == pytest.approx(1.0, rel=1e-12)
    assert binomial_interval(0.0, 10.0)[0] == 0.0


def test_order_statistics_of_few_samples_reach_to_the_ends():
    assert order_shares(0.99, 20.0)[1] == 1.0
    assert order_shares(0.5, 100.0) == pytest.approx((0.402, 0.598), abs=1e-3)


@pytest.fixture
def honest(instants_of, answers_of):
    """Errors drawn from a claimed covariance, scaled."""
    return partial(drawn_from_claim, instants_of, answers_of)


def drawn_from_claim(instants_of, answers_of, n=4000, scale=1.0):
    covariance = np.array([[0.04, 0.01, 0.002], [0.01, 0.09, -0.003], [0.002, -0.003, 0.01]])
    drawn = np.random.default_rng(4).multivariate_normal(np.zeros(3), covariance, n) * scale
    instants = instants_of(0.1 * np.arange(n), *np.zeros((3, n)))
    return instants, answers_of(*drawn.T, covariance), drawn, covariance


def test_honest_filter_is_found_honest(honest):
    instants, answers, _, _ = honest()
    scores = metrics(errors(instants, answers))
    assert scores["anees_band_low"] < scores["anees"] < scores["anees_band_high"]
    assert scores["anees_band_low"] < 1.0 < scores["anees_band_high"]
    assert scores["cover95_low"] < 0.95 < scores["cover95_high"]
    assert scores["anees_n_eff"] > 3500


def test_overconfident_filter_is_found_out(honest):
    instants, answers, _, _ = honest(scale=1.3)
    scores = metrics(errors(instants, answers))
    assert scores["anees"] > scores["anees_band_high"]
    assert scores["cover95_high"] < 0.95


def test_likelihood_and_nees_are_those_of_scipy(honest):
    instants, answers, drawn, covariance = honest(200)
    measured = errors(instants, answers)
    np.testing.assert_allclose(measured.nll, -stats.multivariate_normal([0] * 3, covariance).logpdf(drawn), rtol=1e-9)
    flat = stats.multivariate_normal([0] * 2, covariance[:2, :2])
    np.testing.assert_allclose(measured.nll_2d, -flat.logpdf(drawn[:, :2]), rtol=1e-9)
    np.testing.assert_allclose(
        measured.nees, np.einsum("ni,ij,nj->n", drawn, np.linalg.inv(covariance), drawn), rtol=1e-9
    )


def test_proper_scores_prefer_the_honest_claim(honest, as_columns):
    instants, answers, _, covariance = honest()
    scores = [
        distribution_metrics(errors(instants, answers._replace(covariance=as_columns(f * covariance, 4000))))
        for f in (0.25, 1.0, 4.0)
    ]
    for name in ("nll_2d", "nll_3d", "energy"):
        assert scores[1][name] < min(scores[0][name], scores[2][name])


def test_energy_score_of_a_round_gaussian_has_its_closed_form():
    """At the centre, E‖X‖ - E‖X - X'‖ / 2 = σ √(π / 2) (1 - 1 / √2)."""
    none, var = np.zeros(1), np.full(1, 0.09)
    expected = 0.3 * math.sqrt(math.pi / 2.0) * (1.0 - math.sqrt(0.5))
    assert energy_scores(none, none, var, none, var)[0] == pytest.approx(expected, rel=1e-6)


def test_energy_score_keeps_its_word_on_the_tail_it_approximates():
    by_std = np.linspace(0.0, 8.0, 801)
    exact = 2.0 * stats.norm.sf(by_std)
    np.testing.assert_allclose(_tail(by_std) * np.exp(-0.5 * by_std**2), exact, atol=2.5e-5)


def test_energy_score_of_a_certain_claim_is_the_error():
    none = np.zeros(1)
    score = energy_scores(np.array([3.0]), np.array([-4.0]), none, none, none)
    assert score[0] == pytest.approx(5.0, rel=0.007)


@pytest.mark.parametrize(("dx", "dy", "xx", "xy", "yy"), [(0.1, 0.2, 0.04, 0.01, 0.09), (0.5, -0.3, 0.04, 0.03, 0.05)])
def test_energy_score_is_the_integral_over_all_directions(dx, dy, xx, xy, yy):
    def score(angle):
        u = np.array([math.cos(angle), math.sin(angle)])
        std = math.sqrt(xx * u[0] ** 2 + 2.0 * xy * u[0] * u[1] + yy * u[1] ** 2)
        z = (dx * u[0] + dy * u[1]) / std
        return std * (z * (2.0 * stats.norm.cdf(z) - 1.0) + 2.0 * stats.norm.pdf(z) - 1.0 / math.sqrt(math.pi))

    expected = integrate.quad(score, 0.0, math.pi)[0] / 2.0
    got = energy_scores(*(np.array([value]) for value in (dx, dy, xx, xy, yy)))[0]
    assert got == pytest.approx(expected, rel=2e-3)


def test_energy_score_agrees_with_draws():
    dx, dy, covariance = 0.2, -0.1, np.array([[0.04, 0.015], [0.015, 0.02]])
    r = np.random.default_rng(5)
    draws, others = (r.multivariate_normal([0, 0], covariance, 200_000) for _ in range(2))
    expected = (
        np.linalg.norm(draws + np.array([dx, dy]), axis=1).mean() - 0.5 * np.linalg.norm(draws - others, axis=1).mean()
    )
    columns = (np.array([v]) for v in (dx, dy, covariance[0, 0], covariance[0, 1], covariance[1, 1]))
    assert energy_scores(*columns)[0] == pytest.approx(expected, rel=5e-3)


def test_singular_or_indefinite_claims_are_infinitely_wrong(as_columns):
    error = np.full(3, 0.1)
    claims = np.array([np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 0.0, 1.0]), [[1, 2, 0], [2, 1, 0], [0, 0, 1]]])
    judged = judge(error, error, error, as_columns(claims, 3))
    assert np.isinf(judged.nees).all()
    assert np.isinf(judged.nll).all()
    assert np.isinf(judged.nees_2d).tolist() == [False, True, True]
    assert np.isfinite(judged.energy).all()


def test_only_what_was_claimed_is_judged(oracle_a):
    instants, answers = oracle_a
    some = answers.covariance.copy()
    some[::2] = np.nan
    judged = metrics(errors(instants, answers._replace(covariance=some)))
    half = errors(instants, answers)
    assert judged["anees"] == pytest.approx(half.nees[1::2].mean() / 3.0, rel=1e-12)


def test_series_that_never_changes_follows_its_own_leader():
    r = np.random.default_rng(6)
    white, slow, constant = r.normal(size=1000), np.cumsum(r.normal(size=1000)), np.ones(1000)
    series = np.array([white, constant, slow, constant])
    first, second, third, fourth = effective_sizes(series, np.array([0, 0, 2, 2]))
    assert first == second != third == fourth


def test_intervals_of_a_claim_at_some_instants_are_those_of_these_instants_alone(honest):
    """All series are transformed at once only where every instant has a claim."""
    instants, answers, _, _ = honest(2000)
    half = answers._replace(covariance=np.where(np.arange(2000)[:, None] < 1000, answers.covariance, np.nan))
    some, rest = metrics(errors(instants, half)), metrics(errors(instants.at(np.arange(1000)), first_of(answers, 1000)))
    for name in ("anees_n_eff", "anees_band_low", "cover95_n_eff", "cover95_low"):
        assert some[name] == pytest.approx(rest[name], rel=1e-12)
    assert some["n_eff"] == pytest.approx(metrics(errors(instants, answers))["n_eff"], rel=1e-12)


def first_of(answers, count):
    return type(answers)(*(column[:count] for column in answers))
