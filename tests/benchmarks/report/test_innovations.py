"""Mean NIS in a report: an honest filter's lies in its band, and correlated readings prove less."""

import re

import numpy as np
import pytest

from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.innovations import mean_nis
from benchmarks.report.innovations import innovations
from benchmarks.report.report import report
from benchmarks.report.report_data import ReportData
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import read_results
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from tests.benchmarks.suite_files import write_suite

WIFI, RANGES = 0, 1
N = 4000


def fates_of(nis, kind, anchor):
    n, none = len(nis), np.zeros(len(nis), dtype=np.int16)
    columns = (np.arange(n), np.full(n, kind), none, anchor, none, none, np.ones(n), np.zeros(n), np.ones(n), nis)
    return FateColumns(*map(np.asarray, columns), np.array(["a", "b", "c"]))


@pytest.fixture
def innovation():
    """White and of variance one: what an honest filter's scaled innovations are."""
    return np.random.default_rng(7).normal(size=N)


def test_mean_of_an_honest_filter_lies_in_the_band_of_as_many_readings(innovation):
    nis = mean_nis(fates_of(innovation**2, WIFI, np.arange(N) % 2))
    assert nis.keys() == {"wifi"}
    assert nis["wifi"].mean == pytest.approx(np.mean(innovation**2), rel=1e-12)
    assert nis["wifi"].is_inside
    # The normal approximation of chi-square: the mean of N squares has the variance 2 / N.
    assert nis["wifi"].high - 1.0 == pytest.approx(1.96 * np.sqrt(2.0 / N), rel=0.25)


@pytest.mark.parametrize("claimed", [0.25, 4.0])
def test_claims_that_are_wrong_by_four_lie_outside(innovation, claimed):
    nis = mean_nis(fates_of(innovation**2 / claimed, RANGES, np.zeros(N, dtype=int)))["ranges"]
    assert not nis.is_inside
    assert nis.mean > nis.high if claimed < 1.0 else nis.mean < nis.low


def test_readings_that_repeat_each_other_prove_less(innovation):
    alike = np.repeat(innovation[: N // 20], 20)
    nis = mean_nis(fates_of(alike**2, WIFI, np.zeros(N, dtype=int)))["wifi"]
    white = mean_nis(fates_of(innovation**2, WIFI, np.zeros(N, dtype=int)))["wifi"]
    assert nis.high - nis.low > 3.0 * (white.high - white.low)


def test_readings_without_a_prediction_have_no_row():
    assert mean_nis(fates_of(np.full(N, np.nan), WIFI, np.zeros(N, dtype=int))) == {}


SUITE = """
[suite]
name = "nis"
[[runs]]
id = "mec"
scenario = "mec"
duration_s = 20.0
[[estimators]]
id = "ekf"
use = "ekf"
[[estimators]]
id = "wheels"
use = "dead_reckoning"
"""


def test_report_lists_the_mean_nis_of_its_cells_and_marks_what_lies_outside(tmp_path):
    suite, store = write_suite(tmp_path, SUITE), Store(tmp_path / "store")
    run_suite(suite, store, workers=1)
    data = ReportData(suite, read_results(cells_of(suite, store), store), store)
    (row,) = innovations(data).rows
    cell = data.series["mec", "ekf"]
    assert row[:2] == ("ekf", "wifi")
    assert row[2] == f"{100.0 * cell.result.metrics['nis95_wifi']:.0f} %"
    bold, mean, low, high = re.fullmatch(
        r"(\*\*)?\[([\d.]+)\]\(#cell-\d+\)(?:\*\*)? \[([\d.]+), ([\d.]+)\]", row[3]
    ).groups()
    assert mean == f"{np.nanmean(cell.fates.nis):.2f}"
    assert (bold is None) == (float(low) <= float(mean) <= float(high))
    assert "**Innovations: mean NIS" in report(data)
