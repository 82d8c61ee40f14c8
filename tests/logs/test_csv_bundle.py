"""The CSV bundle: what is written is what is measured, to the nanosecond, and mistakes are told by file and line."""

import math

import pytest

from fusion import Gyro, Odometry, Ranges, RecordingError, WheelTicks, WifiScan
from logs.importing import import_recordings
from logs.reader import read_run

WORLD = """
[[anchors]]
id = "a"
position_m = [0.0, 0.0]
[[anchors]]
id = "b"
position_m = [5.0, 0.0]
[[anchors]]
id = "c"
position_m = [0.0, 5.0]
"""
FILES = {
    "world.toml": WORLD,
    "odometry.csv": "turn_rad,time_s,distance_m\n0,1652380260.171842098,0.1\n0,1652380260.371842098,0.1\n",
    "ticks.csv": "time_s,left,right\n1652380260.1,3,4\n",
    "gyro.csv": "time_s,rate_rad_s\n1652380260.2,0.01\n",
    "ranges.csv": "time_s,anchor,range_m,std_m\n1652380260.3,a,1.5,0.1\n1652380260.3,far,nan,\n",
    "rssi.csv": "time_s,anchor,rssi_dbm\n1652380260.4,b,-60\n",
    "truth.csv": "time_s,x_m,y_m\n1652380260.0,1,2\n1652380260.371842098,1,2.2\n",
}


@pytest.fixture
def bundle(tmp_path):
    folder = tmp_path / "walk"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def imported(folder):
    (path,) = import_recordings("csv", folder, folder.parent / "out.mcap")
    return read_run(path)


def only(run, kind):
    return [measurement for measurement in run.measurements if isinstance(measurement, kind)]


def test_everything_written_is_in_the_log_to_the_nanosecond(bundle):
    run = imported(bundle)
    assert [m.time_ns for m in only(run, Odometry)] == [1652380260171842098, 1652380260371842098]
    assert [m.time_ns - m.from_ns for m in only(run, Odometry)] == [200_000_000, 200_000_000]
    assert [m.counts for m in only(run, WheelTicks)] == [(3, 4)]
    assert [m.rate_rad_s for m in only(run, Gyro)] == [0.01]
    assert [m.readings[0].rssi_dbm for m in only(run, WifiScan)] == [-60.0]
    assert len(run.truth) == 2


def test_rows_of_one_time_form_one_measurement_and_odd_readings_are_kept(bundle):
    (ranges,) = only(imported(bundle), Ranges)
    assert [reading.anchor for reading in ranges.readings] == ["a", "far"]
    assert math.isnan(ranges.readings[1].range_m)
    assert [reading.std_m for reading in ranges.readings] == [0.1, None]


def test_start_heading_is_found_from_motion_where_the_truth_has_none(bundle):
    run = imported(bundle)
    assert run.prior.heading_known
    assert run.prior.pose.heading == pytest.approx(math.pi / 2)
    assert "motion" in run.metadata["prior"]


@pytest.mark.parametrize("name", [name for name in FILES if name != "world.toml"])
def test_any_table_may_be_missing(bundle, name):
    (bundle / name).unlink()
    assert imported(bundle).measurements


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("ranges.csv", "time_s,anchor,range\n1,a,2\n", "did you mean 'range'"),
        ("ranges.csv", "time_s,anchor,range_m\n1,a,2\n2,a,far\n", r"ranges\.csv:3: range_m is 'far'"),
        ("gyro.csv", "time_s,rate_rad_s\nnoon,2\n", r"gyro\.csv:2: time_s"),
        ("gyro.csv", "time_s,rate_rad_s\n1\n", r"gyro\.csv:2: rate_rad_s"),
        ("ticks.csv", "time_s,left,right\n1,nan,2\n", r"ticks\.csv:2: left is 'nan', not a whole number"),
    ],
)
def test_mistake_is_told_by_file_and_line(bundle, name, text, message):
    (bundle / name).write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        imported(bundle)


def test_bundle_without_world_is_refused(bundle):
    (bundle / "world.toml").unlink()
    with pytest.raises(RecordingError, match=r"no world\.toml"):
        imported(bundle)
