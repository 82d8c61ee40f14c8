"""NIS and whiteness of innovations whose statistics are known."""

import math

import numpy as np
import pytest

from benchmarks.metrics.fates import FateColumns
from benchmarks.metrics.innovations import innovation_metrics, ljung_box
from fusion import Decision, Estimate, Fate, Odometry, Pose, RangeReading, Ranges, Reason, RssiReading, Update, WifiScan


def updates_of(kind, reading, innovations, variance=1.0):
    """One update per row of ``innovations`` (n, anchors)."""
    updates = []
    for k, row in enumerate(innovations):
        names = [f"ap{i}" for i in range(len(row))]
        fates = tuple(
            Fate(k, "radio", k, name, Decision.USED, Reason.OK, 1.0, float(value), variance, float(value**2 / variance))
            for name, value in zip(names, row, strict=True)
        )
        measurement = kind(k, "radio", k, tuple(reading(name, -50.0) for name in names))
        updates.append(Update(measurement, Estimate(k, Pose(0.0, 0.0, 0.0), None), fates))
    return updates


def test_honest_white_innovations_pass():
    scores = innovation_metrics(
        FateColumns.of(updates_of(WifiScan, RssiReading, np.random.default_rng(1).normal(size=(500, 3))))
    )
    assert scores["nis95_wifi"] == pytest.approx(0.95, abs=0.02)
    assert scores["white_wifi"] > 0.05


def test_innovations_twice_as_large_as_claimed_are_seen():
    drawn = 2.0 * np.random.default_rng(2).normal(size=(500, 1))
    assert innovation_metrics(FateColumns.of(updates_of(Ranges, RangeReading, drawn)))["nis95_ranges"] < 0.75


def test_slow_innovations_are_not_white():
    slow = np.cumsum(np.random.default_rng(3).normal(size=(300, 1)), axis=0)
    assert innovation_metrics(FateColumns.of(updates_of(Ranges, RangeReading, slow, 100.0)))["white_ranges"] < 1e-6


def test_each_kind_of_sensor_is_judged_by_itself():
    drawn = np.random.default_rng(4).normal(size=(60, 2))
    both = updates_of(WifiScan, RssiReading, drawn) + updates_of(Ranges, RangeReading, drawn)
    assert set(innovation_metrics(FateColumns.of(both))) == {"nis95_wifi", "white_wifi", "nis95_ranges", "white_ranges"}


def test_method_without_predictions_has_no_figure():
    fate = Fate(0, "radio", 0, "ap0", Decision.USED, Reason.OK, 1.0)
    scan = WifiScan(0, "radio", 0, (RssiReading("ap0", -50.0),))
    still = Odometry(0, "wheels", 0, -1, 0.0, 0.0)
    estimate = Estimate(0, Pose(0.0, 0.0, 0.0), None)
    assert innovation_metrics(FateColumns.of([Update(scan, estimate, (fate,)), Update(still, estimate, ())])) == {}


def test_ljung_box_of_one_lag_has_its_closed_form():
    """Ten values, so two lags; the p-value of two degrees of freedom is exp(-Q / 2)."""
    values = np.array([1.0, -1.0] * 5)
    correlations = -0.9, 0.8
    statistic = 10.0 * 12.0 * (correlations[0] ** 2 / 9.0 + correlations[1] ** 2 / 8.0)
    assert ljung_box([values]) == pytest.approx(math.exp(-0.5 * statistic), rel=1e-9)


def test_series_too_short_or_constant_say_nothing():
    assert math.isnan(ljung_box([np.arange(4.0), np.ones(100)]))


def test_whiteness_test_is_wrong_as_often_as_it_says():
    r = np.random.default_rng(5)
    p_values = np.array([ljung_box([r.normal(size=200) for _ in range(3)]) for _ in range(400)])
    assert 0.02 <= (p_values < 0.05).mean() <= 0.09
