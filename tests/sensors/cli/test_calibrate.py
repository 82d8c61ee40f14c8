"""The command line: what is printed, written and refused; a world file keeps what is not calibrated."""

import dataclasses
import json
import tomllib

import numpy as np
import pytest

from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.matching import match
from benchmarks.runner.estimator_run import run_estimator
from fusion import Odometry, Truth, World
from fusion.cli.main import main
from fusion.odometry import Odometer
from fusion.world import Calibration
from logs.truth import evaluation_instants
from logs.writer import RunWriter
from sensors.calibration.world_file import calibrated_text, world_text
from sensors.cli.calibrate_odometry import findings as odometry_findings
from sensors.cli.calibrate_radio import findings as radio_findings

WORLD = """\
# the hall, measured on a rainy day
name = "hall"
[[anchors]]
id = "a" # above the door
position_m = [0.0, 0.0, 2.0]
radio = { path_loss_exponent = 3.0 }
[[anchors]]
id = "b"
position_m = [12.0, 0.0, 2.0]
[[anchors]]
id = "c"
position_m = [6.0, 9.0, 2.0]
[robot]
drive = "differential" # two wheels
track_width_m = 0.3 # with a ruler
ticks_per_revolution = 200
"""
RECORD = Calibration("by hand", ("a.mcap",), ("00",), "unknown", 3, 0.5, "0")


@pytest.fixture(scope="module")
def log(drive, tmp_path_factory):
    """A drive with everything on board, as a file."""
    run = drive(gyro_hz=50.0, wifi_hz=1.0, range_hz=5.0, pause_s=1.5, distance_scale_bias=0.03)
    path = tmp_path_factory.mktemp("log") / "drive.mcap"
    with RunWriter(path, run.world, name="drive", prior=run.prior) as writer:
        for measurement in run.measurements:
            writer.write(measurement)
        write_truth(writer, run)
    return path


def write_truth(writer, run):
    for time_ns, *pose in zip(run.truth.time_ns, run.truth.x, run.truth.y, run.truth.heading, strict=True):
        writer.write_truth(Truth(int(time_ns), *map(float, pose)))


@pytest.mark.parametrize("sensor", ["radio", "odometry", "gyro"])
def test_each_sensor_fills_the_world_and_keeps_its_text(log, tmp_path, capsys, sensor):
    world, output = tmp_path / "hall.toml", tmp_path / "out.toml"
    world.write_text(WORLD)
    paths = {"--world": world, "-o": output, "--json": tmp_path / "out.json", "--png": tmp_path / "out.png"}
    options = [str(word) for pair in paths.items() for word in pair]
    assert main(["calibrate", sensor, str(log), *options]) == 0
    assert "held-out error" in capsys.readouterr().out
    text = output.read_text()
    for comment in ("# the hall, measured on a rainy day", "# above the door", "# two wheels"):
        assert comment in text
    loaded = World.from_toml(text)
    about = loaded.calibration[sensor]
    assert about.logs == ("drive.mcap",)
    assert len(about.sha256[0]) == 64
    assert about.recorded == "unknown"
    told = json.loads((tmp_path / "out.json").read_text())
    assert told["calibrates"] == sensor
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")


def test_calibrations_add_up_in_one_file_and_come_out_the_same_again(log, tmp_path, capsys):
    world = tmp_path / "hall.toml"
    world.write_text(WORLD)
    for sensor in ("odometry", "radio", "gyro"):
        assert main(["calibrate", sensor, str(log), "--world", str(world), "-o", str(world)]) == 0
    once = world.read_text()
    assert set(World.from_toml(once).calibration) == {"odometry", "radio", "gyro"}
    robot = World.from_toml(once).robot
    assert robot.distance_scale == pytest.approx(1.0 / 1.03, abs=0.01)
    assert main(["calibrate", "odometry", str(log), "--world", str(world), "-o", str(world)]) == 0
    capsys.readouterr()
    assert World.from_toml(world.read_text()).robot.track_width_m == pytest.approx(robot.track_width_m, rel=0.01)


def test_an_anchors_own_key_does_not_hide_what_was_fitted_for_all():
    text = calibrated_text(
        WORLD, {"radio": {"path_loss_exponent": 2.2}}, {"a": {"radio": {"path_loss_exponent": 2.2}}}, "radio", RECORD
    )
    assert {anchor.radio.path_loss_exponent for anchor in World.from_toml(text).anchors} == {2.2}
    assert tomllib.loads(text)["calibration"]["radio"]["samples"] == 3


def test_ready_made_increments_are_judged_and_fill_no_world(drive, tmp_path, capsys):
    """What a robot's own computer made of its ticks: the world's wheels do not touch it."""
    run = drive(laps=2, distance_scale_bias=0.03)
    odometer, path = Odometer(run.world.robot, run.measurements[0].time_ns), tmp_path / "made.mcap"
    with RunWriter(path, run.world, name="made") as writer:

        def write(from_ns, time_ns, distance_m, turn_rad, measured):
            writer.write(Odometry(time_ns, "encoders", time_ns // 1_000_000, from_ns, distance_m, turn_rad, measured))

        for ticks in run.measurements:
            odometer.advance(ticks, write)
        write_truth(writer, run)
    output = tmp_path / "world.toml"
    assert main(["calibrate", "odometry", str(path), "-o", str(output)]) == 1
    said = capsys.readouterr()
    assert "0.97" in said.out
    assert "correct the driver" in said.err
    assert "not written" in said.err
    assert not output.exists()


def test_json_alone_goes_to_stdout(log, capsys):
    assert main(["calibrate", "odometry", str(log), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["result"]["held_out"]
    assert told["about"]["logs"] == ["drive.mcap"]


def test_an_estimator_is_better_for_it_on_another_drive(drive):
    """Anchors off by some 6 dB and wheels that are wrong: calibrated on one route, driven on another."""
    reality = {"wifi_hz": 2.0, "distance_scale_bias": 0.05, "track_scale_bias": 0.08, "anchor_offset_std_db": 6.0}
    errors = []
    for seed in range(3):
        places = [[1.0, 1.0], [11.0, 1.0], [11.0, 8.0], [1.0, 8.0], [1.0, 1.0], [6.0, 4.5], [11.0, 8.0], [6.0, 1.0]]
        first = drive(seed, waypoints=[*places, [1.0, 8.0], [6.0, 8.0], [3.0, 2.0], [9.0, 3.0], [1.0, 1.0]], **reality)
        other = drive(seed, waypoints=[[2.0, 2.0], [10.0, 7.0], [2.0, 7.0], [10.0, 2.0], [2.0, 2.0]], **reality)
        text = world_text(first.world, None)
        for found in (radio_findings([first]), odometry_findings([first])):
            text = calibrated_text(text, found.changes, found.anchors, found.name, RECORD)
        runs = other, dataclasses.replace(other, world=World.from_toml(text))
        errors.append([rmse(run) for run in runs])
    before, after = np.median(errors, axis=0)
    assert after < 0.6 * before


def rmse(run):
    """Of the EKF [m]."""
    instants = evaluation_instants(run.truth)
    said = match(instants, Track.of(run_estimator(run, "ekf", seed=0).updates))
    assert said.valid.mean() > 0.9
    return float(np.sqrt(np.nanmean(np.square(said.x - instants.x) + np.square(said.y - instants.y))))


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["calibrate"], 2, "required: sensor"),
        (["calibrate", "wheels"], 2, "choose from"),
        (["calibrate", "--", "radio"], 1, "put the sensor first"),
        (["calibrate", "radio", "nowhere.mcap"], 1, "no such file"),
        (["calibrate", "radio", "LOG", "--place", "0"], 1, "greater than zero"),
        (["calibrate", "odometry", "LOG", "--segments", "nowhere.csv"], 1, "cannot be read"),
        (["calibrate", "gyro", "LOG", "--turns", "0"], 1, "not zero"),
    ],
)
def test_wrong_use_is_told_in_one_sentence(log, capsys, words, code, message):
    try:
        got = main([str(log) if word == "LOG" else word for word in words])
    except SystemExit as stopped:
        got = stopped.code
    assert got == code
    told = capsys.readouterr().err
    assert message in told
    assert "Traceback" not in told
