"""Claims against the errors that seeds show: closed forms, and what a finite number of seeds makes of them."""

import math

import numpy as np
import pytest
from scipy.special import digamma

from benchmarks.metrics.credibility import LEAST_SEEDS, credibility_metrics
from benchmarks.metrics.errors import errors

ACTUAL = np.diag([0.04, 0.09, 0.01])


@pytest.fixture
def seeds_of(instants_of, answers_of):
    """Errors of each seed from (seeds, n, 3) and one claimed covariance."""

    def seeds(drawn, claimed, heading=True):
        zero = np.zeros((3, drawn.shape[1]))
        instants = instants_of(0.1 * np.arange(drawn.shape[1]), *zero)
        turn = (lambda one: one[:, 2]) if heading else (lambda one: np.full(len(one), np.nan))
        return [errors(instants, answers_of(one[:, 0], one[:, 1], turn(one), claimed)) for one in drawn]

    return seeds


def crossed(n=7):
    """Six seeds, one on either side of each axis: their mean square is `ACTUAL` to the last digit."""
    axes = np.sqrt(3.0 * np.diag(ACTUAL)) * np.eye(3)
    return np.repeat(np.vstack([axes, -axes])[:, None], n, axis=1)


@pytest.mark.parametrize("scale", [0.1, 0.5, 1.0, 4.0])
@pytest.mark.parametrize("heading", [True, False])
def test_a_claim_that_is_a_multiple_of_the_actual_one_is_that_many_decibels_off(seeds_of, scale, heading):
    drawn = crossed()[[0, 1, 3, 4, 0, 1, 3, 4]] / math.sqrt(1.5) if not heading else crossed()
    actual = np.einsum("kni,knj->ij", drawn, drawn) / (drawn.shape[0] * drawn.shape[1])
    if not heading:
        actual[2, 2] = 1.0
    found = credibility_metrics([seeds_of(drawn, scale * actual, heading)])
    assert found["incl"] == pytest.approx(-10.0 * math.log10(scale), abs=1e-9)
    assert found["nci"] == pytest.approx(10.0 * abs(math.log10(scale)), abs=1e-9)


@pytest.mark.parametrize("count", [5, 12, 40])
def test_an_honest_claim_reads_what_so_many_seeds_leave(seeds_of, count):
    drawn = np.random.default_rng(count).multivariate_normal(np.zeros(3), ACTUAL, (count, 20_000 // count))
    found = credibility_metrics([seeds_of(drawn, ACTUAL)])
    expected = 10.0 / math.log(10.0) * (digamma(count / 2.0) - math.log(count / 2.0))
    assert found["incl"] == pytest.approx(expected, abs=0.06)
    assert found["incl"] == pytest.approx(-4.3 / count, abs=0.15)
    assert abs(found["incl"]) < found["nci"] < 3.0


def test_too_certain_on_one_axis_and_too_modest_on_the_other_does_not_cancel_in_the_index(seeds_of):
    found = credibility_metrics([seeds_of(crossed(), ACTUAL * [10.0, 0.1, 1.0])])
    assert found["incl"] == pytest.approx(0.0, abs=1e-9)
    assert found["nci"] == pytest.approx(20.0 / 3.0, abs=1e-9)


def test_runs_are_pooled_by_their_instants(seeds_of):
    modest, certain = seeds_of(crossed(3), 10.0 * ACTUAL), seeds_of(crossed(1), 0.1 * ACTUAL)
    assert credibility_metrics([modest, certain])["incl"] == pytest.approx(-5.0, abs=1e-9)


def test_nothing_is_said_of_too_few_seeds_of_seeds_that_change_nothing_and_without_claims(seeds_of):
    few, same = crossed()[: LEAST_SEEDS - 1], np.repeat(crossed()[:1] + 0.1, 6, axis=0)
    for drawn, claimed in ((few, ACTUAL), (same, ACTUAL), (crossed(), np.full((3, 3), np.nan))):
        assert all(math.isnan(value) for value in credibility_metrics([seeds_of(drawn, claimed)]).values())
    assert math.isnan(credibility_metrics([])["nci"])


def test_certainty_that_is_wrong_is_infinitely_far_off(seeds_of):
    assert credibility_metrics([seeds_of(crossed(), 0.0 * ACTUAL)])["nci"] == math.inf


def test_an_instant_that_some_seed_did_not_answer_is_left_out(seeds_of):
    seeds = seeds_of(crossed(), ACTUAL)
    gone = seeds[0]._replace(dx=seeds[0].dx * [np.nan, *[1.0] * 6], nees=seeds[0].nees * [np.nan, *[1.0] * 6])
    assert credibility_metrics([[gone, *seeds[1:]]])["nci"] == pytest.approx(0.0, abs=1e-9)
