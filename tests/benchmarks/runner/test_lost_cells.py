"""Cells that were lost have a reason and no score of the part before, in the leaderboard and in the report."""

import math

import pytest

import fusion
from benchmarks.cli import bench_run as run_verb
from benchmarks.report.report_data import ReportData
from benchmarks.report.tables import fixes, leaderboard, limits, lost
from benchmarks.runner import leaderboard as stored
from benchmarks.runner.execute import carry_out
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import read_results
from benchmarks.runner.store import Store
from estimators.dead_reckoning import DeadReckoning
from fusion import Pose
from fusion.values import nanoseconds
from tests.benchmarks.suite_files import write_suite

SUITE = """
[suite]
name = "lost"
eval = {{ reading = "{reading}" }}
[[runs]]
id = "office"
scenario = "office"
duration_s = 12.0
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "poisoned"
use = "toy_poisoned"
[[estimators]]
id = "radio"
use = "radio_only"
[[faults]]
id = "silence"
apply = [{{ kind = "drop", topic = "wifi", windows = [[3.0, 12.0]] }}]
"""
FLATTERING = ("pos_rmse", "pos_mean", "pos_max", "head_rmse", "anees", "along_rmse", "rpe_t_1s_rmse", "energy")
CAUSE = "it answers x nan m, y nan m, heading nan rad, "


class Poisoned(DeadReckoning):
    """Dead reckoning that answers NaN from the second second on."""

    __module__ = DeadReckoning.__module__  # a suite hashes the code of an estimator's package, and tests are none

    def estimate(self, state, motion, time_ns):
        answer = super().estimate(state, motion, time_ns)
        return answer if time_ns < nanoseconds(2.0) else answer._replace(pose=Pose(*[math.nan] * 3))


@pytest.fixture(scope="module", params=["causal", "interp"])
def data(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    suite, store = write_suite(folder, SUITE.format(reading=request.param)), Store(folder / "store")
    with fusion.registered("toy_poisoned", Poisoned):
        cells = cells_of(suite, store)
        for cell in cells:
            carry_out((cell, store.folder))
        yield ReportData(suite, read_results(cells, store), store)


def of(data, estimator, fault="clean"):
    (found,) = [one for one in data.results if (one.cell.estimator.id, one.cell.fault.id) == (estimator, fault)]
    return found


def test_answer_that_is_no_number_loses_the_cell_with_its_reason(data):
    poisoned = of(data, "poisoned")
    assert poisoned.status == "diverged"
    assert poisoned.error.startswith(CAUSE)
    assert (poisoned.metrics["availability"], poisoned.metrics["pos_p75"]) == (0.0, math.inf)
    assert all(math.isfinite(of(data, "wheels").metrics[name]) for name in FLATTERING)
    assert all(math.isnan(poisoned.metrics[name]) for name in FLATTERING)
    assert poisoned.worst_at_s is None


def test_cell_that_fell_silent_keeps_its_availability_and_no_mean_of_its_answers(data):
    silent = of(data, "radio", "silence")
    assert silent.status == "diverged"
    assert 0.0 < silent.metrics["availability"] <= 0.5
    assert silent.error == f"only {100.0 * silent.metrics['availability']:.1f} % of the instants have a valid answer"
    assert all(math.isnan(silent.metrics[name]) for name in FLATTERING)
    assert silent.metrics["pos_p75"] == math.inf


def test_leaderboards_show_a_dash_and_the_run_states_why(data):
    for table in (stored.suite_leaderboard(data.results), leaderboard(data)):
        (row,) = [row for row in table.rows if row[0].startswith("poisoned")]
        shown = dict(zip(table.head, row, strict=True))
        assert [
            text for title, text in shown.items() if title.startswith(("RMSE", "mean", "max", "heading", "ANEES"))
        ] == ["–"] * 5
        assert table.rows[-1][0].startswith("poisoned")
    sentences = run_verb.lost(data.results)
    assert any(line.startswith(f"poisoned lost 2 of its cells: {CAUSE}") for line in sentences)
    assert any(line.startswith("radio lost 1 of its cells: only ") for line in sentences)


def test_report_states_why_and_compares_no_lost_cell_with_physics(data):
    reasons = {row[0].partition("]")[0]: row[2] for row in lost(data).rows}
    assert reasons["[office poisoned clean 0"].startswith(f"`{CAUSE}")
    for table in (limits(data), fixes(data)):
        shown = {row[0]: row[1] for row in table.rows}
        assert shown["poisoned"] == "–" != shown["wheels"]
