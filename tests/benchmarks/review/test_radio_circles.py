"""Radio readings as columns, and their circles."""

import math

import numpy as np
import pytest

import fusion
from benchmarks.review.radio_circles import ReadingColumns
from fusion import Gyro, RangeReading, Ranges, RssiReading, WifiScan

WORLD = fusion.World.from_table(
    {
        "name": "w",
        "robot": {"antenna_m": [0.0, 0.0, 0.5]},
        "anchors": [
            {"id": "a", "position_m": [0, 0, 3.5]},
            {"id": "b", "position_m": [4, 0, 0.5]},
            {"id": "c", "position_m": [0, 4]},
        ],
    }
)


def test_radius_is_the_distance_on_the_floor_less_the_height_between_the_antennas():
    readings = ReadingColumns.of_run(WORLD, [Ranges(5, "uwb", 1, (RangeReading("a", 5.0), RangeReading("b", 5.0)))])
    assert readings.radius_of[5, "uwb", 1, "a"] == pytest.approx(4.0)
    assert readings.radius_of[5, "uwb", 1, "b"] == pytest.approx(5.0)


def test_range_shorter_than_the_height_stands_under_the_anchor():
    assert (
        ReadingColumns.of_run(WORLD, [Ranges(5, "uwb", 1, (RangeReading("a", 2.0),))]).radius_of[5, "uwb", 1, "a"]
        == 0.0
    )


def test_signal_strength_is_turned_into_a_distance_by_the_anchors_own_model():
    readings = ReadingColumns.of_run(WORLD, [WifiScan(5, "wifi", 1, (RssiReading("b", -60.0),))])
    assert readings.radius_of[5, "wifi", 1, "b"] == pytest.approx(float(WORLD.anchors[1].radio.distance(-60.0)))


def test_stranger_and_reading_that_is_no_number_have_no_circle_and_keep_their_row():
    readings = ReadingColumns.of_run(
        WORLD, [WifiScan(5, "wifi", 1, (RssiReading("zzz", -60.0), RssiReading("a", math.nan)))]
    )
    assert np.isnan(list(readings.radius_of.values())).tolist() == [True, True]
    assert readings.anchor.tolist() == ["zzz", "a"]
    assert readings.is_range.tolist() == [False, False]


def test_run_without_radio_has_no_rows():
    assert ReadingColumns.of_run(WORLD, [Gyro(0, "gyro", 0, 0.1)]).value.tolist() == []
