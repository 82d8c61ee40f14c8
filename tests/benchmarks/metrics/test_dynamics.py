"""Convergence, failures, silence and drift on errors made for the purpose."""

import math

import numpy as np
import pytest

from benchmarks.metrics.convergence import (
    convergence_metrics,
    failure_metrics,
    fault_metrics,
    silence_metrics,
    stretches,
)
from benchmarks.metrics.drift import MOST_PAIRS, drift_metrics, pairs_of, theil_sen
from benchmarks.metrics.errors import errors


@pytest.fixture
def off_by(instants_of, answers_of):
    """Errors of a robot that stands in one cell, at 10 Hz unless told; infinite: no valid answer."""

    def measured(position, *, period_s=0.1, x=0.5, **columns):
        position = np.asarray(position, dtype=float)
        n = len(position)
        place, none = np.broadcast_to(np.asarray(x, dtype=float), n), np.zeros(n)
        instants = instants_of(period_s * np.arange(n), place, none + 0.5, none)
        answers = answers_of(place + position, none + 0.5, none, valid=np.isfinite(position))
        return errors(instants, answers._replace(**columns))

    return measured


def test_stretches_are_the_longest():
    found = stretches(np.array([True, True, False, True, True, True]))
    assert (found.first.tolist(), found.last.tolist()) == ([0, 3], [1, 5])
    assert len(stretches(np.zeros(6, dtype=bool)).first) == 0


def test_convergence_is_the_first_time_below_a_metre_for_five_seconds(off_by):
    position = np.full(200, 2.0)
    position[10:40] = 0.5
    position[100:] = 0.5
    assert convergence_metrics(off_by(position)) == {"t_conv": 10.0}


def test_run_that_ends_before_five_seconds_are_over_has_not_converged(off_by):
    position = np.full(100, 2.0)
    position[51:] = 0.5
    assert convergence_metrics(off_by(position)) == {"t_conv": math.inf}


def test_failure_is_told_with_its_peak_growth_and_recovery(off_by):
    position = np.full(300, 0.5)
    position[100:150] = 3.5 + 0.02 * np.arange(50)
    position[150:180] = 2.0
    scores = failure_metrics(off_by(position))
    assert scores["failures"] == 1.0
    assert scores["max_in_outage"] == pytest.approx(3.5 + 0.02 * 49)
    assert scores["growth"] == pytest.approx(0.2)
    assert scores["t_recover"] == pytest.approx(3.1)


def test_short_excursion_is_no_failure(off_by):
    position = np.full(300, 0.5)
    position[100:115] = 9.0
    scores = failure_metrics(off_by(position))
    assert scores["failures"] == 0.0
    assert all(math.isnan(scores[name]) for name in ("t_recover", "max_in_outage", "growth"))


def test_silence_is_a_failure_that_has_no_peak(off_by):
    scores = failure_metrics(off_by(np.concatenate([np.full(100, 0.5), np.full(100, math.inf)])))
    assert scores["failures"] == 1.0
    assert scores["t_recover"] == math.inf
    assert math.isnan(scores["max_in_outage"])


FAULT_IDS = ("fault_availability", "fault_t_recover", "fault_max_in_outage", "fault_growth")


def test_fault_is_told_by_its_window_whatever_the_error_outside(off_by):
    """From 5 s to 10 s after the start, which is 1 s before the first instant: instants 40 to 89."""
    position = np.full(300, 0.2)
    position[10:20] = 50.0
    position[40:90] = 0.5 + 0.02 * np.arange(50)
    position[60:70] = math.inf
    position[90:125] = 1.2
    scores = fault_metrics(off_by(position), -1_000_000_000, ((5.0, 10.0),))
    assert tuple(scores) == FAULT_IDS
    assert scores["fault_availability"] == 0.8
    assert scores["fault_t_recover"] == pytest.approx(3.5, rel=1e-12)
    assert scores["fault_max_in_outage"] == pytest.approx(0.5 + 0.02 * 49, rel=1e-12)
    assert scores["fault_growth"] == pytest.approx(0.2, rel=1e-9)


def test_fault_that_hurts_nobody_is_recovered_from_at_once(off_by):
    scores = fault_metrics(off_by(np.full(300, 0.2)), 0, ((5.0, 10.0),))
    assert scores == pytest.approx(dict(zip(FAULT_IDS, (1.0, 0.0, 0.2, 0.0), strict=True)))


def test_recovery_counts_from_the_end_of_the_window_and_not_from_an_instant(off_by):
    scores = fault_metrics(off_by(np.full(30, 0.2), period_s=4.0), 0, ((5.0, 9.0),))
    assert scores["fault_t_recover"] == 3.0


def test_of_several_windows_the_worst_counts_and_the_availability_of_all(off_by):
    position = np.full(400, 0.2)
    position[50:100] = 0.9
    position[200:250] = math.inf
    position[250:260] = 2.0
    scores = fault_metrics(off_by(position), 0, ((5.0, 10.0), (20.0, 25.0)))
    assert scores["fault_availability"] == 0.5
    assert scores["fault_max_in_outage"] == pytest.approx(0.9)
    assert scores["fault_t_recover"] == pytest.approx(1.0)


def test_recovery_that_the_run_does_not_see_is_infinite_and_one_it_cannot_see_unknown(off_by):
    position = np.full(200, 0.2)
    position[50:160] = 2.0
    measured = off_by(position)
    assert fault_metrics(measured, 0, ((5.0, 10.0),))["fault_t_recover"] == math.inf
    for end_s in (20.0, math.inf):
        scores = fault_metrics(measured, 0, ((5.0, end_s),))
        assert math.isnan(scores["fault_t_recover"])
        assert scores["fault_max_in_outage"] == 2.0


@pytest.mark.parametrize("windows", [(), ((30.0, 40.0),), ((5.02, 5.08),)])
def test_fault_without_an_instant_inside_says_nothing(off_by, windows):
    scores = fault_metrics(off_by(np.full(200, 0.2)), 0, windows)
    assert tuple(scores) == FAULT_IDS
    assert all(map(math.isnan, scores.values()))


def test_availability_is_unknown_where_instants_are_those_of_the_answers(off_by):
    measured = off_by(np.full(200, 0.2))._replace(weight=np.ones(200))
    scores = fault_metrics(measured, 0, ((5.0, 10.0),))
    assert math.isnan(scores["fault_availability"])
    assert scores["fault_max_in_outage"] == pytest.approx(0.2)


def test_silence_is_counted_and_timed_up_to_the_next_answer(off_by):
    position = np.full(100, 0.2)
    position[10:15] = position[95:] = math.inf
    scores = silence_metrics(off_by(position, age_s=np.linspace(0.0, 1.0, 100)))
    assert scores["dropouts"] == 2.0
    assert scores["dropout_s"] == pytest.approx(0.5 + 0.4)
    assert scores["age_p95"] == pytest.approx(0.95)


def test_coverage_counts_cells_of_the_floor_and_not_instants(off_by):
    position = np.full(100, 0.2)
    position[91:] = math.inf
    x = np.concatenate([np.full(90, 0.5), np.full(10, 1.5)])
    assert silence_metrics(off_by(position, x=x))["coverage"] == 0.5
    assert silence_metrics(off_by(position))["coverage"] == 0.0
    assert silence_metrics(off_by(np.full(100, 0.2)))["coverage"] == 1.0


def test_drift_since_the_last_fix_is_the_slope_of_the_error(off_by):
    since = np.arange(1000) % 50 / 10.0
    position = 0.3 + 0.07 * since
    position[::9] += 5.0
    measured = off_by(position, since_fix_s=since)
    assert drift_metrics(measured)["eag"] == pytest.approx(0.07, abs=1e-3)


def test_nothing_known_of_fixes_means_no_drift(off_by):
    assert math.isnan(drift_metrics(off_by(np.full(10, 0.1)))["eag"])


def test_slope_of_a_few_points_is_the_median_over_all_pairs():
    at, values = np.array([0.0, 1.0, 1.0, 3.0, 6.0]), np.array([0.0, 1.0, 5.0, 2.0, 8.0])
    pairs = [(i, j) for j in range(5) for i in range(j) if at[i] != at[j]]
    slopes = [(values[j] - values[i]) / (at[j] - at[i]) for i, j in pairs]
    assert theil_sen(at, values) == pytest.approx(np.median(slopes), rel=1e-12)
    assert math.isnan(theil_sen(np.zeros(4), np.arange(4.0)))
    assert math.isnan(theil_sen(np.zeros(0), np.zeros(0)))


@pytest.mark.parametrize("count", [0, 1, 2, 3, 77, 1000, 100_001])
def test_pairs_are_few_enough_different_and_in_order(count):
    first, second = pairs_of(count)
    assert len(set(zip(first.tolist(), second.tolist(), strict=True))) == len(first)
    assert len(first) == count * (count - 1) // 2 if count <= 77 else MOST_PAIRS // 2 < len(first) <= MOST_PAIRS
    assert ((first >= 0) & (first < second) & (second < max(count, 1))).all()
