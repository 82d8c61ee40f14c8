"""The metrics against figures worked out independently, with no random numbers in them."""

import math

import numpy as np
import pytest

from benchmarks.instants import Instants, evaluation_instants, match
from benchmarks.score import Errors, errors, metrics, pool, quantile
from benchmarks.track import Track
from fusion import Covariance, Estimate, Odometry, Pose, Update, wrap_angle
from logs.run import TruthTrack

STEP_NS = 100_000_000
TIME_S = 0.1 * np.arange(1000)
X, Y = 5.0 * np.sin(0.1 * TIME_S), 2.5 * np.sin(0.2 * TIME_S)
HEADING = np.arctan2(0.5 * np.cos(0.2 * TIME_S), 0.5 * np.cos(0.1 * TIME_S))
TRUTH = TruthTrack(np.arange(1000, dtype=np.int64) * STEP_NS, X, Y, HEADING)


def oracle_updates(count=1000, *, covariance=True, heading_known=True):
    claimed = Covariance(0.04, 0.0, 0.0, 0.01, 0.0, 0.0001) if covariance else None
    updates = []
    for k in range(count):
        t = TIME_S[k]
        pose = Pose(
            X[k] + 0.30 + 0.05 * math.sin(1.7 * t),
            Y[k] - 0.10 + 0.05 * math.cos(2.3 * t),
            wrap_angle(HEADING[k] + 0.02 * math.sin(0.9 * t)),
        )
        estimate = Estimate(k * STEP_NS, pose, claimed, heading_known=heading_known)
        updates.append(Update(Odometry(k * STEP_NS, "wheels", k, (k - 1) * STEP_NS, 0.0, 0.0), estimate, ()))
    return updates


def scores_of(updates, truth=TRUTH):
    instants = evaluation_instants(truth)
    return metrics(errors(instants, match(instants, Track.of(updates))))


ORACLE_A = {
    "pos_mean": 0.318218697728,
    "pos_rmse": 0.320193678649,
    "pos_std": 0.0355084815659,
    "pos_min": 0.254986288633,
    "pos_max": 0.380741018030,
    "pos_p50": 0.318084754996,
    "pos_p75": 0.350547843092,
    "pos_p90": 0.365139175487,
    "pos_p95": 0.372341194236,
    "pos_p99": 0.378811734925,
    "pos_auc": 0.893927100757,
    "head_mae": math.radians(0.730949330814),
    "head_rmse": math.radians(0.811757898985),
    "head_p95": math.radians(1.14231332879),
    "anees": 1.80522950724,
    "anees_2d": 1.70420466671,
    "cover95": 0.909,
    "availability": 1.0,
    "n": 1000.0,
    "n_valid": 1000.0,
}


@pytest.mark.parametrize("name", ORACLE_A)
def test_metric_of_the_reference_run_is_as_worked_out(name):
    assert scores_of(oracle_updates())[name] == pytest.approx(ORACLE_A[name], rel=1e-9)


def test_every_metric_has_a_reference_figure():
    assert set(scores_of(oracle_updates())) == set(ORACLE_A)


def test_estimator_that_died_after_five_seconds_cannot_look_healthy():
    scores = scores_of(oracle_updates(50))
    assert scores["n_valid"] == 60.0
    assert scores["availability"] == pytest.approx(0.06, rel=1e-9)
    assert scores["pos_p50"] == scores["pos_p75"] == math.inf
    assert scores["pos_auc"] == pytest.approx(0.0536074051223, rel=1e-9)
    assert scores["pos_rmse"] == pytest.approx(0.322438565188, rel=1e-9)


def test_without_heading_consistency_is_judged_on_the_position_alone():
    scores = scores_of(oracle_updates(heading_known=False))
    assert scores["anees"] == scores["anees_2d"] == pytest.approx(1.70420466671, rel=1e-9)
    assert scores["cover95"] == 1.0
    assert math.isnan(scores["head_rmse"])
    assert math.isnan(scores["head_p95"])


def test_truth_without_heading_asks_for_none():
    blind = TruthTrack(TRUTH.time_ns, X, Y, np.full(1000, np.nan))
    scores = scores_of(oracle_updates(), blind)
    assert scores["anees"] == pytest.approx(1.70420466671, rel=1e-9)
    assert math.isnan(scores["head_mae"])


def test_no_covariance_claimed_means_no_consistency_figure():
    scores = scores_of(oracle_updates(covariance=False))
    assert all(math.isnan(scores[name]) for name in ("anees", "anees_2d", "cover95"))
    assert scores["pos_rmse"] == pytest.approx(ORACLE_A["pos_rmse"], rel=1e-9)


def test_certainty_that_is_wrong_is_infinitely_inconsistent():
    updates = oracle_updates(10)
    certain = [u._replace(estimate=u.estimate._replace(covariance=Covariance(*[0.0] * 6))) for u in updates]
    scores = scores_of(certain)
    assert scores["anees"] == math.inf
    assert scores["cover95"] == 0.0


def test_a_silent_estimator_has_no_mean_and_infinite_quantiles():
    scores = scores_of([])
    assert scores["availability"] == scores["pos_auc"] == 0.0
    assert math.isnan(scores["pos_rmse"])
    assert scores["pos_p99"] == math.inf


def test_quantile_meets_infinity_where_numpy_answers_nan():
    values = np.array([1.0, 2.0, np.inf])
    assert quantile(values, 0.5) == 2.0
    assert quantile(values, 0.75) == math.inf
    assert math.isnan(quantile(np.array([]), 0.5))


def test_quantile_is_numpys_on_finite_values():
    values = np.sin(np.arange(101.0))
    for share in (0.0, 0.123, 0.5, 0.95, 1.0):
        assert quantile(values, share) == pytest.approx(np.quantile(values, share), rel=1e-12)


def test_pooling_weighs_every_instant_alike():
    def run_of(*position):
        n = len(position)
        return Errors(np.array(position), np.zeros(n), np.ones(n), np.full(n, 3), np.ones(n))

    both = metrics(pool([run_of(1.0), run_of(3.0, math.inf, 3.0)]))
    assert both["n"] == 4.0
    assert both["pos_mean"] == pytest.approx(7.0 / 3.0)
    assert both["availability"] == 0.75


def test_scores_of_no_instants_are_not_numbers():
    nothing = np.array([])
    instants = Instants(nothing.astype(np.int64), nothing, nothing, nothing)
    assert math.isnan(metrics(errors(instants, match(instants, Track.of([]))))["availability"])
