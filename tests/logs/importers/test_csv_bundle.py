"""The CSV bundle: what is written is what was measured to the nanosecond; mistakes are reported by file and line."""

import math

import numpy as np
import pytest

from fusion import Gyro, LogError, Odometry, Ranges, RecordingError, WheelTicks, WifiScan
from fusion.cli.main import main
from logs.cli.import_ import import_recordings
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


def truth_csv(*rows):
    return "\n".join(["time_s,x_m,y_m,heading_rad", *rows]) + "\n"


@pytest.mark.parametrize("unknown", ["", "nan", "NaN", "-nan", " "])
def test_heading_that_is_empty_or_no_number_is_not_known_row_by_row(bundle, unknown):
    rows = [f"1652380260.0,1,2,{unknown}", "1652380260.1,1,2.1,1.5", f"1652380260.371842098,1,2.2,{unknown}"]
    (bundle / "truth.csv").write_text(truth_csv(*rows), encoding="utf-8")
    run = imported(bundle)
    assert np.isnan(run.truth.heading).tolist() == [True, False, True]
    assert run.truth.heading[1] == pytest.approx(1.5, abs=1e-15)
    assert run.prior.pose == pytest.approx((1.0, 2.0, math.pi / 2))
    assert "motion" in run.metadata["prior"]
    assert run.warnings == ()


def test_start_without_heading_or_motion_is_a_known_place_and_a_uniform_heading(bundle):
    (bundle / "odometry.csv").unlink()
    (bundle / "truth.csv").write_text(truth_csv("1652380260.0,1,2,nan"), encoding="utf-8")
    prior = imported(bundle).prior
    assert (prior.position_known, prior.heading_known, prior.pose[:2]) == (True, False, (1.0, 2.0))
    assert prior.covariance.hh == pytest.approx(math.tau**2 / 12.0)


def test_rows_without_a_position_are_left_out_counted_and_no_start(bundle, capsys):
    rows = ["1652380260.0,,2,0.5", "1652380260.1,1,NaN,0.5", "1652380260.2,1,2.1,", "1652380260.371842098,1,2.2,"]
    (bundle / "truth.csv").write_text(truth_csv(*rows), encoding="utf-8")
    run = imported(bundle)
    assert run.truth.y.tolist() == [2.1, 2.2]
    assert (run.prior.time_ns, run.prior.pose[:2], run.prior.heading_known) == (1652380260200000000, (1.0, 2.1), True)
    assert "2 of 4 true poses have no position, and are left out" in run.warnings[0]
    assert "warning: walk: 2 of 4 true poses have no position, and are left out" in capsys.readouterr().err


def test_truth_without_any_position_is_none(bundle):
    (bundle / "truth.csv").write_text(truth_csv("1652380260.0,nan,nan,0.5", "1652380260.1,,,0.5"), encoding="utf-8")
    run = imported(bundle)
    assert (run.truth, run.prior) == (None, None)
    assert "none of the 2 true poses has a position, so there is no ground truth" in run.warnings[0]


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
        (
            "truth.csv",
            truth_csv("1,2,3,inf"),
            r"truth\.csv:2: heading_rad is 'inf', not a finite number; leave it empty",
        ),
        ("truth.csv", truth_csv("1,2,3,0", "2,-inf,3,0"), r"truth\.csv:3: x_m is '-inf', not a finite number"),
        ("truth.csv", truth_csv("1,2,3,north"), r"truth\.csv:2: heading_rad is 'north', not a number"),
        ("ticks.csv", "time_s,left,right\n1,nan,2\n", r"ticks\.csv:2: left is 'nan', not a whole number"),
    ],
)
def test_mistake_is_reported_by_file_and_line(bundle, name, text, message):
    (bundle / name).write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        imported(bundle)


def test_bundle_without_world_is_refused(bundle):
    (bundle / "world.toml").unlink()
    with pytest.raises(RecordingError, match=r"no world\.toml"):
        imported(bundle)


def test_log_that_exists_is_written_over_only_by_force(bundle, tmp_path, capsys):
    output = tmp_path / "run.mcap"
    output.write_bytes(b"the only copy")
    words = ["import", "csv", str(bundle), "-o", str(output)]
    assert main(words) == 1
    assert "run.mcap: exists already; choose another name, or write over a file with --force" in capsys.readouterr().err
    assert output.read_bytes() == b"the only copy"
    assert main([*words, "--force"]) == 0
    assert read_run(output).measurements


def test_folder_gets_no_log_where_one_of_that_name_exists(bundle, tmp_path):
    (tmp_path / "out").mkdir()
    (there := tmp_path / "out" / f"{bundle.name}.mcap").write_bytes(b"the only copy")
    with pytest.raises(LogError, match="exists already"):
        import_recordings("csv", bundle, tmp_path / "out")
    assert there.read_bytes() == b"the only copy"
    there.unlink()
    there.mkdir()
    with pytest.raises(LogError, match="exists already"):
        import_recordings("csv", bundle, tmp_path / "out", force=True)
