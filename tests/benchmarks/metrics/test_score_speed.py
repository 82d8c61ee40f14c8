"""What scoring may cost, without a clock: how often the dearest parts run, and that the measurement of speed works."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from benchmarks.metrics import effective_samples as samples
from benchmarks.metrics.errors import errors
from benchmarks.metrics.score import metrics
from logs import truth as course


@pytest.fixture
def transforms(monkeypatch):
    """The shapes of all series that are transformed."""
    shapes, forward = [], np.fft.rfft

    def counted(series, length):
        shapes.append(series.shape)
        return forward(series, length)

    monkeypatch.setattr(samples.np.fft, "rfft", counted)
    return shapes


def test_all_series_are_transformed_at_once(oracle_a, transforms):
    metrics(errors(*oracle_a))
    assert transforms == [(8, 1000)]


def test_series_of_fewer_claims_are_transformed_by_themselves(oracle_a, transforms):
    instants, answers = oracle_a
    some = np.where(np.arange(1000)[:, None] % 2, answers.covariance, np.nan)
    metrics(errors(instants, answers._replace(covariance=some)))
    assert transforms == [(6, 1000), (2, 500)]


def test_what_follows_from_the_truth_alone_is_found_once_for_all_estimators(oracle_a, monkeypatch):
    instants, answers = oracle_a
    before = metrics(errors(instants, answers))
    for work in ("ahead", "later", "points"):
        monkeypatch.setattr(course, work, None)
    assert metrics(errors(instants, answers._replace(x=answers.x + 1.0)))["rpe_d_1m_n"] == before["rpe_d_1m_n"]


def test_long_series_are_transformed_a_few_at_a_time_to_spare_memory(instants_of, answers_of, transforms):
    noise = np.random.default_rng(1).normal(size=(3, 40_000))
    instants = instants_of(0.1 * np.arange(40_000), *np.zeros((3, 40_000)))
    metrics(errors(instants, answers_of(*noise, np.eye(3))))
    assert transforms == [(1, 40_000)] * 8


def test_cost_of_a_pair_is_told_by_kinds_of_metrics():
    told = runpy.run_path(str(Path(__file__).with_name("score_speed.py")))
    costs = {cost.what: cost for cost in told["measure"](poses=50, rounds=2, pairs=1)}
    assert set(costs) > {told["ANCHOR"], told["PAIR"], told["RESCORED"], "match", "errors", "trajectory"}
    assert costs[told["ANCHOR"]].ratio == 1.0
    assert all(cost.least_us > 0.0 for cost in costs.values())


def test_cost_of_two_files_is_that_of_a_process_that_scored_them():
    told = runpy.run_path(str(Path(__file__).with_name("score_speed.py")))
    cost = told["measure_files"](poses=50, rounds=1)
    assert cost.cpu_s > 0.0
    assert cost.rss_mb > 10.0
    with pytest.raises(SystemExit, match="failed"):
        told["measure_files"](poses=50, rounds=1, words=("--mode", "none"))
