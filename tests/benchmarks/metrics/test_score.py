"""The metrics against figures worked out independently, with no random numbers in them."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.matching import match
from benchmarks.metrics.score import errors, for_json, metrics, quantile
from fusion import Covariance, Estimate, Odometry, Pose, Update, wrap_angle
from logs.truth import Instants, TruthTrack, evaluation_instants

ROOT = Path(__file__).resolve().parents[3]
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
    "abs_x_mean": 0.30000952666,
    "abs_x_max": 0.349999999789,
    "abs_y_mean": 0.100088643686,
    "abs_y_max": 0.149999338153,
    "bias_x": 0.30000952666,
    "bias_y": -0.100088643686,
    "cov_xx": 0.00124748192996,
    "cov_xy": -3.56180777536e-5,
    "cov_yy": 0.00125305723505,
    "drms": 0.0500053913595,
    "2drms": 2.0 * 0.0500053913595,
    "along_rmse": 0.234548557469,
    "along_bias": -0.00612183834645,
    "cross_rmse": 0.217970103537,
    "cross_bias": 0.023856166222,
    "path_ratio": 1.01000359605,
    "rpe_t_1s_n": 990.0,
    "rpe_t_1s_rmse": 0.0837788095342,
    "rpe_t_1s_median": 0.0831990363,
    "rpe_t_1s_rot_rmse": math.radians(0.703576457277),
    "rpe_d_1m_n": 981.0,
    "rpe_d_1m_rmse": 0.0785468691663,
    "rpe_d_1m_median": 0.0688422791141,
    "rpe_d_1m_rot_rmse": math.radians(1.33719396241),
    "rpe_d_5m_n": 922.0,
    "rpe_d_5m_rmse": 0.0836858033392,
    "rpe_d_5m_median": 0.0760050137008,
    "rpe_d_5m_rot_rmse": math.radians(1.29181294808),
    "rpe_d_10m_n": 809.0,
    "rpe_d_10m_rmse": 0.106045560734,
    "rpe_d_10m_median": 0.0911928673387,
    "rpe_d_10m_rot_rmse": math.radians(1.05108796251),
    "cover95_2d": 1.0,
    "nll_2d": -0.369941272312,
    "nll_3d": -3.05253333094,
    "jump_rate": 0.0,
    "age_p95": 0.0,
    "dropouts": 0.0,
    "dropout_s": 0.0,
    "coverage": 1.0,
    "failures": 0.0,
    "t_conv": 0.0,
}


def test_distribution_function_at_the_named_radii_is_rayleighs(instants_of, answers_of):
    """Errors at the middles of 20 000 equal shares of 1 - exp(-r² / 2 σ²): what is counted is off by half a share."""
    share = (np.arange(20_000) + 0.5) / 20_000
    error = 0.8 * np.sqrt(-2.0 * np.log1p(-share))
    instants = instants_of(0.1 * np.arange(20_000), *np.zeros((3, 20_000)))
    scores = metrics(errors(instants, answers_of(error, *np.zeros((2, 20_000)))))
    for name, radius_m in (("10cm", 0.1), ("30cm", 0.3), ("50cm", 0.5), ("1m", 1.0), ("2m", 2.0), ("3m", 3.0)):
        assert scores[f"pos_cdf_{name}"] == pytest.approx(1.0 - math.exp(-(radius_m**2) / 1.28), abs=3e-5)


@pytest.mark.parametrize("name", ORACLE_A)
def test_metric_of_the_reference_run_is_as_worked_out(name):
    assert scores_of(oracle_updates())[name] == pytest.approx(ORACLE_A[name], rel=1e-9)


def test_every_metric_has_one_documented_name():
    told = set(re.findall(r"`(\w+)`", (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")))
    families = re.compile(r"(rpe_[dt]_\d+m?s?|pos_p\d\d(?=_)|pos_cdf_\d+c?m|abs_[xy]|along|cross|(?<=rpe)rot)")
    for name in scores_of(oracle_updates()):
        assert name in told or families.match(name), name


def test_estimator_that_died_after_five_seconds_cannot_look_healthy():
    scores = scores_of(oracle_updates(50))
    assert scores["n_valid"] == 60.0
    assert scores["availability"] == pytest.approx(0.06, rel=1e-9)
    assert scores["pos_p50"] == scores["pos_p75"] == math.inf
    assert scores["pos_auc"] == pytest.approx(0.0536074051223, rel=1e-9)
    assert (scores["pos_cdf_10cm"], scores["pos_cdf_3m"]) == (0.0, 0.06)
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
    assert scores["head_n"] == 0.0


def test_heading_errors_are_of_the_instants_whose_true_heading_is_known_and_counted():
    off = HEADING + 1.0
    off[::2] = HEADING[::2]
    updates = oracle_updates()
    whole, lying = scores_of(updates), scores_of(updates, TruthTrack(TRUTH.time_ns, X, Y, off))
    known = np.where(np.arange(1000) % 2 == 0, HEADING, np.nan)
    half = scores_of(updates, TruthTrack(TRUTH.time_ns, X, Y, known))
    assert (whole["head_n"], half["head_n"]) == (1000.0, 500.0)
    assert lying["head_rmse"] > 0.5
    assert half["head_rmse"] == pytest.approx(whole["head_rmse"], rel=0.05)
    assert half["pos_rmse"] == whole["pos_rmse"]


def test_no_covariance_claimed_means_no_consistency_figure():
    scores = scores_of(oracle_updates(covariance=False))
    assert all(math.isnan(scores[name]) for name in ("anees", "anees_2d", "cover95"))
    assert scores["pos_rmse"] == pytest.approx(ORACLE_A["pos_rmse"], rel=1e-9)


def test_certainty_that_is_wrong_is_infinitely_inconsistent():
    updates = oracle_updates(10)
    sure = Covariance(*[0.0] * 6)
    certain = [Update(u.measurement, u.estimate._replace(covariance=sure), u.fates) for u in updates]
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


def test_scores_of_no_instants_are_not_numbers():
    nothing = np.array([])
    instants = Instants(nothing.astype(np.int64), nothing, nothing, nothing)
    scores = metrics(errors(instants, match(instants, Track.of([]))))
    counts = {"n", "n_valid", "failures", *(name for name in scores if name.endswith("_n"))}
    assert all(scores[name] == 0.0 for name in counts)
    assert all(math.isnan(scores[name]) for name in set(scores) - counts)


AXES = ("abs_", "bias_", "cov_", "coverage")
"""What may change when the map is turned or moved, cells of the floor among it."""


@settings(derandomize=True, max_examples=25)
@given(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.integers(0, 400))
def test_turning_and_moving_the_world_leaves_all_but_the_axis_metrics(as_columns, yaw, shift_x, shift_y, dead):
    instants = evaluation_instants(TRUTH)
    answers = match(instants, Track.of(oracle_updates()))
    answers = answers._replace(valid=np.arange(1000) >= dead, since_fix_s=np.arange(1000) % 7 / 10.0)
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])

    def moved(poses):
        x, y = shift_x + cos * poses.x - sin * poses.y, shift_y + sin * poses.x + cos * poses.y
        return {"x": x, "y": y, "heading": poses.heading + yaw}

    claimed = answers.covariance[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    turned = answers._replace(**moved(answers), covariance=as_columns(turn @ claimed @ turn.T, 1000))
    before, after = metrics(errors(instants, answers)), metrics(errors(replace(instants, **moved(instants)), turned))
    for name in before:
        if not name.startswith(AXES):
            assert after[name] == pytest.approx(before[name], rel=1e-6, abs=1e-9, nan_ok=True), name


def test_a_score_for_json_has_no_infinity():
    assert for_json({"a": 1.0, "b": math.inf, "c": math.nan}) == {"a": 1.0, "b": None, "c": None}
