"""Tracks read from files, to the nanosecond, and what is refused with which words."""

import math

import numpy as np
import pytest

import fusion
from benchmarks.metrics.track_files import read_track, read_truth
from fusion import Covariance, Estimate, LogError, Odometry, Pose, Truth, Update
from logs.cli.export import export_csv, export_tum
from logs.writer import RunWriter

WORLD = fusion.World.from_table({"name": "corridor", "bounds": {"x_min": 0, "x_max": 8, "y_min": -1, "y_max": 3}})
START_NS = 1_652_380_260_171_842_098


def write(path, *lines):
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return path


def log_at(path, *estimator_runs, truth=True):
    with RunWriter(path, WORLD, name="run") as log:
        for k in range(5):
            time_ns = START_NS + k * 100_000_000
            odometry = Odometry(time_ns, "wheels", k, time_ns - 100_000_000, 0.1, 0.0)
            log.write(odometry)
            if truth:
                log.write_truth(Truth(time_ns, 0.1 * k, 0.2, None if k == 2 else 0.1 * k))
            for name in estimator_runs:
                claimed = Covariance.from_std(0.1, 0.2, 0.3)
                estimate = Estimate(time_ns, Pose(0.1 * k + 0.5, 0.2, 0.3), claimed, valid=k != 1)
                log.write_update(name, Update(odometry, estimate, ()))
    return path


def test_tum_file_is_read_to_the_nanosecond(tmp_path):
    path = write(tmp_path / "a.tum", "# a comment", "1652380260.171842098 1 2 0 0 0 0 1", "1652380261 3 4 0 0 0 1 0")
    track = read_track(path)
    assert track.time_ns.tolist() == [START_NS, 1_652_380_261_000_000_000]
    assert track.pose[:, :2].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert track.heading.tolist() == [0.0, math.pi]
    assert track.valid.all()
    assert np.isnan(track.covariance).all()


@pytest.mark.parametrize(
    ("text", "time_ns"),
    [
        ("0", 0),
        ("0.5", 500_000_000),
        (".25", 250_000_000),
        ("12.", 12_000_000_000),
        ("-1.5", -1_500_000_000),
        ("1.7e9", 1_700_000_000_000_000_000),
        ("1.700000000000000000e+09", 1_700_000_000_000_000_000),
        ("+3.000000001", 3_000_000_001),
        ("1652380260.1718420989999", START_NS),
        ("8999999999.999999999", 8_999_999_999_999_999_999),
    ],
)
def test_times_in_any_spelling_are_read_exactly(tmp_path, text, time_ns):
    assert read_track(write(tmp_path / "a.tum", f"{text} 0 0 0 0 0 0 1")).time_ns.tolist() == [time_ns]


def test_heading_of_a_tilted_robot_is_its_yaw_and_a_quaternion_may_have_any_length(tmp_path):
    yaw, pitch = 1.2, 0.3
    cy, sy, cp, sp = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    quaternion = " ".join(str(5.0 * value) for value in (-sp * sy, sp * cy, cp * sy, cp * cy))
    track = read_track(write(tmp_path / "a.tum", f"0 0 0 0 {quaternion}"))
    assert track.heading[0] == pytest.approx(yaw, rel=1e-12)


def test_csv_may_leave_headings_empty_or_out(tmp_path):
    rows = ("0.5,1,2,", "1.5,3,4,0.25", "2.5,5,6,", "3.5,7,8,NaN")
    some, warnings = read_truth(write(tmp_path / "a.csv", "time_s,x_m,y_m,heading_rad", *rows))
    assert some.time_ns.tolist() == [500_000_000, 1_500_000_000, 2_500_000_000, 3_500_000_000]
    np.testing.assert_array_equal(some.heading, [math.nan, 0.25, math.nan, math.nan])
    assert warnings == ()
    none, _ = read_truth(write(tmp_path / "b.csv", "time_s,x_m,y_m", "0.5,1,2"))
    assert np.isnan(none.heading).all()
    (tmp_path / "c.csv").write_bytes(b"time_s,x_m,y_m,heading_rad\r\n0.5,1,2,\r\n1,1,2,")
    assert np.isnan(read_truth(tmp_path / "c.csv")[0].heading).all()


@pytest.mark.parametrize("rotation", ["0 0 0 0", "nan nan nan nan", "0 0 NaN 1"])
def test_tum_heading_of_a_quaternion_that_is_none_is_not_known(tmp_path, rotation):
    path = write(tmp_path / "a.tum", f"0.5 1 2 0 {rotation}", "1.5 3 4 0 0 0 0 1")
    track = read_track(path)
    np.testing.assert_array_equal(track.heading, [math.nan, 0.0])
    assert track.heading_known.tolist() == [False, True]
    assert track.flaw == ""
    np.testing.assert_array_equal(read_truth(path)[0].heading, [math.nan, 0.0])


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("a.csv", ["time_s,x_m,y_m,heading_rad", "0,,,", "1,1,2,0.5", "2,nan,2,0.5", "3,3,4,"]),
        ("a.csv", ["time_s,x_m,y_m", "0,,", "1,1,2", "2,2,", "3,3,4"]),
        ("a.tum", ["0 nan nan nan 0 0 0 1", "1 1 2 0 0 0 0 1", "2 NaN 2 0 0 0 0 1", "3 3 4 0 0 0 0 0"]),
    ],
)
def test_true_poses_without_a_position_are_left_out_and_counted(tmp_path, name, lines):
    truth, warnings = read_truth(write(tmp_path / name, *lines))
    assert (truth.x.tolist(), truth.y.tolist()) == ([1.0, 3.0], [2.0, 4.0])
    assert warnings == (f"{tmp_path / name}: 2 of 4 true poses have no position, and are left out",)
    with pytest.raises(LogError, match="pose 1 holds no position; remove the row"):
        read_track(tmp_path / name)


def test_truth_without_any_position_is_none(tmp_path):
    with pytest.raises(LogError, match=r"none of the 2 true poses has a position.*holds no ground truth"):
        read_truth(write(tmp_path / "a.csv", CSV, "0,nan,1,0", "1,,2,0"))


def test_what_a_log_exports_is_read_back(tmp_path):
    log = log_at(tmp_path / "run.mcap", "ekf")
    truth, _ = read_truth(log)
    export_csv(log, tmp_path / "csv")
    export_tum(log, tmp_path / "tum")
    back, _ = read_truth(tmp_path / "csv" / "truth.csv")
    turned, _ = read_truth(tmp_path / "tum" / "truth.tum")
    for name in ("time_ns", "x", "y", "heading"):
        np.testing.assert_array_equal(getattr(back, name), getattr(truth, name))
        np.testing.assert_allclose(getattr(turned, name), getattr(truth, name), atol=1e-15)
    assert read_track(tmp_path / "tum" / "ekf.tum").time_ns.tolist() == np.delete(truth.time_ns, 1).tolist()


def test_lane_of_a_log_keeps_claims_and_what_was_not_valid_is_not_in_it(tmp_path):
    log = log_at(tmp_path / "run.mcap", "ekf", "particle")
    track = read_track(f"{log}:ekf")
    assert track.valid.all()
    assert (track.time_ns - START_NS).tolist() == [0, 200_000_000, 300_000_000, 400_000_000]
    np.testing.assert_allclose(track.covariance[0], [0.01, 0.0, 0.0, 0.04, 0.0, 0.09], rtol=1e-12)
    only = log_at(tmp_path / "one.mcap", "ekf")
    np.testing.assert_array_equal(read_track(only).pose, track.pose)


TUM, CSV = "0 0 0 0 0 0 0 1", "time_s,x_m,y_m,heading_rad"


@pytest.mark.parametrize(
    ("name", "lines", "told"),
    [
        ("a.tum", [TUM, "1 0 0 0 0 0 1"], "is not a table of time x y z qx qy qz qw"),
        ("a.tum", [TUM, "1 0 0 0 0 0 0 one"], "is not a table of time"),
        ("a.tum", [TUM, "1 0 nan 0 0 0 0 1"], "pose 2 holds no position"),
        ("a.tum", [TUM, "1 0 0 0 inf 0 0 1"], "pose 2 holds a number that is infinite"),
        ("a.tum", [TUM, "nan 0 0 0 0 0 0 1"], "'nan' is not a time in seconds"),
        ("a.tum", [TUM, "1..5 0 0 0 0 0 0 1"], "is not a time in seconds"),
        ("a.tum", [TUM, "1652380260171842098 0 0 0 0 0 0 1"], "no time in seconds; divide"),
        ("a.tum", [TUM, "1.00000000000000000000000000000e3 0 0 0 0 0 0 1"], "32 characters or more"),
        ("a.tum", [TUM, "2 0 0 0 0 0 0 1", "1 0 0 0 0 0 0 1"], "pose 3 is not later than the one before"),
        ("a.tum", [TUM, TUM], "pose 2 is not later"),
        ("a.tum", ["# nothing"], "holds no pose"),
        ("a.csv", ["t,x,y", "0,0,0"], "the first line must be time_s,x_m,y_m,heading_rad"),
        ("a.csv", [CSV, "0,0,0"], "is not a table of time_s,x_m,y_m,heading_rad"),
        ("a.csv", [CSV, "0,,0,0"], "pose 1 holds no position"),
        ("a.csv", [CSV, ",0,0,0"], "'' is not a time"),
        ("a.csv", [CSV, "0,nan,0,0"], "pose 1 holds no position"),
        ("a.csv", [CSV, "0,0,0,inf"], "pose 1 holds a number that is infinite"),
        ("a.csv", [CSV], "holds no pose"),
    ],
)
def test_file_that_is_no_track_is_refused_with_the_reason(tmp_path, name, lines, told):
    with pytest.raises(LogError, match=told) as refusal:
        read_track(write(tmp_path / name, *lines))
    assert name in str(refusal.value)


def test_missing_or_binary_file_is_refused(tmp_path):
    with pytest.raises(LogError, match="cannot be read"):
        read_track(tmp_path / "none.tum")
    (tmp_path / "b.tum").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(LogError, match=r"b\.tum"):
        read_track(tmp_path / "b.tum")


def test_log_without_what_was_asked_for_says_what_it_holds(tmp_path):
    bare = log_at(tmp_path / "bare.mcap", truth=False)
    with pytest.raises(LogError, match="holds no ground truth"):
        read_truth(bare)
    with pytest.raises(LogError, match="add some with `fusion replay`"):
        read_track(bare)
    two = log_at(tmp_path / "two.mcap", "ekf", "particle")
    with pytest.raises(LogError, match="holds estimates of ekf, particle; choose one"):
        read_track(two)
    with pytest.raises(LogError, match="did you mean 'ekf'"):
        read_track(f"{two}:efk")
