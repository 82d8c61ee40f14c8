"""Runs with something taken out."""

import pytest

import fusion
from benchmarks.review.counterfactual import counterfactuals, without_anchor, without_radio_at
from fusion import Gyro, ParameterError, RangeReading, Ranges, RssiReading, WifiScan
from logs.run import Run

SECOND_NS = 1_000_000_000
WORLD = fusion.World.from_table(
    {"name": "w", "anchors": [{"id": n, "position_m": [i, i * i]} for i, n in enumerate("abc")]}
)


def scan(second, *anchors):
    return WifiScan(second * SECOND_NS, "wifi", second, tuple(RssiReading(anchor, -50.0) for anchor in anchors))


def ranges(second, *anchors):
    return Ranges(second * SECOND_NS, "uwb", second, tuple(RangeReading(anchor, 1.0) for anchor in anchors))


def run_of(tmp_path, *measurements):
    return Run(tmp_path / "run.mcap", "run", WORLD, None, {}, measurements, None, (), {})


@pytest.fixture
def run(tmp_path):
    return run_of(
        tmp_path, Gyro(100 * SECOND_NS, "gyro", 0, 0.1), scan(102, "a", "b"), ranges(104, "b"), scan(107, "a")
    )


def test_anchor_taken_out_leaves_everything_else_and_no_empty_scan(run):
    suffix, changed = without_anchor(run, "b")
    assert suffix == "without b"
    assert changed.measurements == (run.measurements[0], scan(102, "a"), scan(107, "a"))
    assert len(run.measurements) == 4


def test_nearest_radio_measurement_is_taken_out_and_named_by_its_time(run):
    suffix, changed = without_radio_at(run, 4.4)
    assert suffix == "reject 4.00 s"
    assert changed.measurements == (run.measurements[0], run.measurements[1], run.measurements[3])


def test_of_two_equally_near_measurements_the_earlier_goes(run):
    assert without_radio_at(run, 3.0).suffix == "reject 2.00 s"


def test_motion_is_never_taken_out(run):
    assert without_radio_at(run, 0.0).run.measurements[0] == run.measurements[0]


def test_same_counterfactual_is_drawn_once(run):
    found = counterfactuals(run, ["a", "a"], [2.0, 2.3, 7.0])
    assert [found.suffix for found in found] == ["without a", "reject 2.00 s", "reject 7.00 s"]


def test_misspelt_anchor_is_refused_with_the_nearest(tmp_path):
    run = run_of(tmp_path, scan(1, "kitchen", "hall"))
    with pytest.raises(ParameterError, match=r"--without kitchn: .* did you mean 'kitchen'"):
        without_anchor(run, "kitchn")


def test_anchor_of_the_world_that_was_never_received_is_refused(run):
    with pytest.raises(ParameterError, match=r"--without c: .* holds no reading of that anchor; known: a, b"):
        without_anchor(run, "c")


def test_time_outside_the_run_is_refused_with_its_length(run):
    with pytest.raises(ParameterError, match=r"--reject 99: .* lasts from 0 to 7\.00 s"):
        without_radio_at(run, 99.0)


def test_run_without_radio_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="no radio measurement"):
        without_radio_at(run_of(tmp_path, Gyro(0, "gyro", 0, 0.1)), 0.0)
