"""The catalogue has a row for every number of a score, and the page of the documentation is its table."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults.inject import read_fault
from benchmarks.metrics.catalogue import (
    COST,
    METRICS,
    as_table,
    column,
    more_is_better,
    require_lower_is_better,
    unit_of,
)
from benchmarks.metrics.families import families
from benchmarks.review.folding import Reviewed
from benchmarks.runner.estimator_run import run_estimator
from benchmarks.runner.reference import Reference
from benchmarks.runner.scoring import score
from fusion import ParameterError
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulated_run

PAGE = Path(__file__).parents[3] / "docs" / "benchmark.md"
SENSORS = ("ranges", "gyro", "ticks", "command", "odom")


@pytest.fixture(scope="module")
def run():
    return simulated_run(load_scenario("office"), 0)


def test_every_number_of_a_score_has_a_row_and_every_row_a_number(run):
    made = run_estimator(run, "ekf")
    fault = read_fault({"kind": "drop", "topic": "wifi", "windows": [[20, 50]]}, "faults[0]")
    measured = score(made.track, made.fates, Reference.of(run), faults=[fault]).metrics
    others = {
        name
        for name in METRICS
        if name.partition("_")[0] in ("nis", "nis95", "white") and name.split("_")[1] in SENSORS
    }
    foreign = families().rows.keys() - METRICS.keys()
    assert measured.keys() - foreign == METRICS.keys() - others - {COST.id}


def test_estimator_without_a_covariance_has_none_of_what_needs_one(run):
    measured = Reviewed.of(run, run_estimator(run, "dynamic_weight")).score.metrics
    needy = [name for name, metric in METRICS.items() if metric.needs == "covariance"]
    assert len(needy) > 10
    assert all(np.isnan(measured[name]) for name in needy)


def test_the_page_has_the_table_of_the_catalogue():
    assert as_table() in PAGE.read_text(encoding="utf-8")


def test_units_and_directions_come_from_the_rows():
    assert unit_of("pos_p75").number(0.123) == "12.3"
    assert column("head_rmse", "RMSE", separator=", ").title == "RMSE, °"
    assert unit_of("a_metric_of_somebody").number(1.234) == "1.23"
    assert more_is_better("availability")
    assert not more_is_better("pos_p75")
    require_lower_is_better("pos_p75")
    for metric in ("availability", "anees", "bias_x", "cover95"):
        with pytest.raises(ParameterError, match=f"a lower {metric} is not better"):
            require_lower_is_better(metric)
    for metric in ("nll_2d", "growth", "fault_growth", "eag"):
        with pytest.raises(ParameterError, match=f"{metric} may be below zero"):
            require_lower_is_better(metric)
