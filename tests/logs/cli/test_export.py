"""`fusion export`: CSV that comes back as the same run, TUM tracks that other tools read."""

import csv
import math
import tomllib

import numpy as np
import pytest

from fusion import (
    Estimate,
    Gyro,
    LogError,
    Odometry,
    Pose,
    RangeReading,
    Ranges,
    RssiReading,
    Truth,
    Update,
    WheelTicks,
    WifiScan,
    World,
)
from fusion.cli.main import main
from logs.cli.export import export_csv, export_tum
from logs.cli.import_ import import_recordings
from logs.reader import read_run
from logs.writer import RunWriter
from tests.worlds import anchored_world

T = 1_652_380_260_171_842_098
WORLD = anchored_world({"ä, b": (0, 0), "c": (1, 0.1)}, name="here")
WORLD_TOML = '[[anchors]]\nid = "c"\nposition_m = [0, 0]\n'
MEASUREMENTS = (
    Odometry(T, "odometry", 0, T - 10, 0.1 + 0.2, -1e-17),
    WheelTicks(T + 1, "ticks", 0, (1, -2, 3, 4)),
    Gyro(T + 2, "gyro", 0, 1 / 3),
    WifiScan(T + 3, "rssi", 0, (RssiReading("ä, b", -51.25), RssiReading("c", -math.inf))),
    Ranges(T + 4, "ranges", 0, (RangeReading("c", 1 / 3), RangeReading("ä, b", 2.0, 0.1))),
    Odometry(T + 10, "odometry", 1, T, 0.2, 0.1),
)
TRUTHS = (Truth(T, 1 / 3, 2.0, 0.25), Truth(T + 10, 0.5, 2.0))


@pytest.fixture
def log(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="run") as writer:
        for truth in TRUTHS:
            writer.write_truth(truth)
        for measurement in MEASUREMENTS:
            writer.write(measurement)
            estimate = Estimate(measurement.time_ns, Pose(1.0, 2.0, math.pi / 2), None)
            writer.write_update("ekf", Update(measurement, estimate, ()))
    return tmp_path / "run.mcap"


def test_bundle_comes_back_as_the_same_measurements(log, tmp_path):
    export_csv(log, tmp_path / "bundle")
    (again,) = import_recordings("csv", tmp_path / "bundle", tmp_path / "again.mcap")
    before, after = read_run(log), read_run(again)
    assert after.measurements == before.measurements == MEASUREMENTS
    assert after.world == before.world
    assert after.truth.time_ns.tolist() == [truth.time_ns for truth in TRUTHS]
    assert after.truth.x.tolist() == [truth.x for truth in TRUTHS]


def test_bundle_has_the_documented_columns_and_the_whole_world(log, tmp_path):
    files = export_csv(log, tmp_path / "bundle")
    texts = {path.stem: path.read_text(encoding="utf-8") for path in files if path.suffix == ".csv"}
    tables = {name: list(csv.reader(text.splitlines())) for name, text in texts.items()}
    assert {name: rows[0] for name, rows in tables.items()} == {
        "odometry": ["time_s", "distance_m", "turn_rad"],
        "ticks": ["time_s", "wheel1", "wheel2", "wheel3", "wheel4"],
        "gyro": ["time_s", "rate_rad_s"],
        "ranges": ["time_s", "anchor", "range_m", "std_m"],
        "rssi": ["time_s", "anchor", "rssi_dbm"],
        "truth": ["time_s", "x_m", "y_m", "heading_rad"],
    }
    assert tables["gyro"][1][0] == "1652380260.171842100"
    assert tables["truth"][2] == ["1652380260.171842108", "0.5", "2.0", ""]
    table = tomllib.loads((tmp_path / "bundle" / "world.toml").read_text(encoding="utf-8"))
    assert World.from_table(table).hash == WORLD.hash


def test_tracks_are_tum_lines_in_time_order(log, tmp_path):
    files = {path.stem: path.read_text().splitlines() for path in export_tum(log, tmp_path / "tracks")}
    assert files.keys() == {"truth", "ekf"}
    time_s, x, y, z, *quaternion = files["ekf"][0].split(" ")
    assert (time_s, float(x), float(y), float(z)) == ("1652380260.171842098", 1.0, 2.0, 0.0)
    assert [float(q) for q in quaternion] == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])
    assert files["truth"][1] == "1652380260.171842108 0.5 2.0 0.0 0.0 0.0 0.0 0.0", "no rotation: no known heading"
    assert files["ekf"] == sorted(files["ekf"])


def test_bundle_keeps_the_rows_whose_heading_is_not_known(tmp_path):
    rows = ["1.0,1.0,2.0,nan", "2.0,1.5,2.0,0.5", "3.0,2.0,2.0,", "4.0,,2.0,0.5"]
    for name, text in (("truth.csv", "time_s,x_m,y_m,heading_rad\n" + "\n".join(rows)), ("world.toml", WORLD_TOML)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "gyro.csv").write_text("time_s,rate_rad_s\n1.0,0.1\n", encoding="utf-8")
    (first,) = import_recordings("csv", tmp_path, tmp_path / "first.mcap")
    export_csv(first, tmp_path / "bundle")
    (again,) = import_recordings("csv", tmp_path / "bundle", tmp_path / "again.mcap")
    before, after = read_run(first), read_run(again)
    assert np.isnan(after.truth.heading).tolist() == [True, False, True]
    for name in ("time_ns", "x", "y", "heading"):
        np.testing.assert_allclose(getattr(after.truth, name), getattr(before.truth, name), atol=1e-15)
    assert (after.prior, after.warnings) == (before.prior, ())


def test_track_whose_heading_is_not_known_has_no_rotation(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="run") as writer:
        for i, known in enumerate((True, False)):
            estimate = Estimate(T + i, Pose(1.0, 2.0, 0.5), None, heading_known=known)
            writer.write_update("ekf", Update(MEASUREMENTS[0], estimate, ()))
    (path,) = export_tum(tmp_path / "run.mcap", tmp_path / "tracks")
    known, unknown = (line.split()[4:] for line in path.read_text().splitlines())
    assert [float(q) for q in known] == pytest.approx([0.0, 0.0, math.sin(0.25), math.cos(0.25)])
    assert unknown == ["0.0"] * 4


def test_track_holds_the_last_word_on_every_time(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="run") as writer:
        for time_ns, x in ((T, 1.0), (T + 10, 2.0), (T, 3.0)):
            estimate = Estimate(time_ns, Pose(x, 0.0, 0.0), None)
            writer.write_update("ekf", Update(MEASUREMENTS[0], estimate, (), revised=x == 3.0))
    (path,) = export_tum(tmp_path / "run.mcap", tmp_path / "tracks")
    assert [line.split()[1] for line in path.read_text().splitlines()] == ["3.0", "2.0"]


def test_tracks_of_a_log_without_any_are_refused_with_the_remedy(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="run") as writer:
        writer.write(MEASUREMENTS[0])
    with pytest.raises(LogError, match="fusion replay"):
        export_tum(tmp_path / "run.mcap", tmp_path / "tracks")


def test_command_lists_what_it_wrote_and_asks_for_one_form(log, tmp_path, capsys):
    assert main(["export", str(log), "-o", str(tmp_path / "tracks"), "--tum"]) == 0
    assert capsys.readouterr().out.splitlines() == [str(tmp_path / "tracks" / f"{n}.tum") for n in ("ekf", "truth")]
    with pytest.raises(SystemExit) as stop:
        main(["export", str(log), "-o", str(tmp_path)])
    assert stop.value.code == 2


def test_folder_that_cannot_be_written_is_one_sentence(log, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(LogError, match="choose another folder"):
        export_csv(log, tmp_path / "file")
