"""`fusion live`: a line of strict JSON for each pose, exit codes, and whole logs however it ends."""

import json
import math
import signal
import subprocess
import sys

import pytest

import fusion
from benchmarks.cli.replay import replay
from fusion import Covariance, Decision, Estimate, Pose
from fusion.cli.main import main
from logs.reader import read_run
from sensors.cli.live import describe, record
from sensors.onboard.live import Now
from tests.sensors.failing_estimator import Breaks
from tests.sensors.robot_files import robot_text

NO_NUMBER = Covariance(math.inf, 0.0, 0.0, 1.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("estimate", "expected"),
    [
        (Estimate(7, Pose(math.nan, 1.0, 0.0), None, p_lost=math.nan), {"valid": False, "x": None, "p_lost": None}),
        (Estimate(7, Pose(2.0, 1.0, 0.0), NO_NUMBER), {"valid": True, "x": 2.0, "covariance": None, "ellipse": None}),
        (Estimate(7, Pose(2.0, 1.0, 0.5), None, heading_known=False), {"valid": True, "y": 1.0, "heading": None}),
        (Estimate(7, Pose(2.0, 1.0, math.inf), None), {"valid": True, "heading": None, "heading_known": False}),
        (Estimate(7, Pose(2.0, 1.0, 0.5), None, valid=False, p_lost=0.9), {"valid": False, "x": None, "p_lost": 0.9}),
        (None, {"valid": False, "x": None, "time_ns": 9}),
    ],
)
def test_a_line_is_strict_json_and_holds_no_number_that_is_not_to_be_used(estimate, expected):
    now = Now(9, estimate, "", 1, {Decision.USED: 2}, (), ())
    line = json.loads(json.dumps(record(now), allow_nan=False))
    assert line | expected == line
    assert line["fates"] == {"used": 2}
    assert describe(now).startswith("(2.00, 1.00)" if expected["valid"] else "no pose")


def refuse(constant):
    raise AssertionError(constant)


def test_the_command_writes_a_line_of_json_a_pose(tmp_path, capsys):
    path = tmp_path / "trolley.toml"
    path.write_text(robot_text())
    words = ["live", str(path), "--estimator", "ekf", "--set", "gate_probability=0.98", "--duration", "1.5"]
    assert main([*words, "--hz", "20", "-o", str(tmp_path / "out"), "--shadow", "dead_reckoning", "--json"]) == 0
    out, err = capsys.readouterr()
    *lines, end = [json.loads(line, parse_constant=refuse) for line in out.splitlines()]
    assert 5 <= len(lines) <= 33
    assert [line["time_ns"] for line in lines] == sorted(line["time_ns"] for line in lines)
    assert lines[-1]["valid"]
    assert abs(lines[-1]["x"] - 1.5) < 1.0
    assert lines[-1]["ellipse"]["major_std"] > 0.0
    assert lines[-1]["age_s"]["gyro"] < 1.0
    assert sum(line["fates"].get("used", 0) for line in lines) >= 3
    assert set(end["ended"]["digests"]) == {"ekf", "dead_reckoning"}
    assert "gyro" in err
    assert main([*words[:3], "ekff"]) == 1
    assert "did you mean 'ekf'" in capsys.readouterr().err
    assert main([*words[:4], "--set", "gate=1"]) == 1
    assert "no parameter 'gate'" in capsys.readouterr().err


def test_the_command_tells_what_went_wrong_and_answers_1(tmp_path, capsys):
    path = tmp_path / "trolley.toml"
    path.write_text(robot_text())
    with fusion.registered("breaks", Breaks):
        assert main(["live", str(path), "--estimator", "breaks", "--duration", "60"]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out.splitlines()[0])["valid"]
    assert "no such weight" in err


def started(tmp_path):
    """`fusion live` in a process of its own, after its first line."""
    path = tmp_path / "trolley.toml"
    path.write_text(robot_text())
    command = [
        sys.executable,
        "-m",
        "fusion.cli.main",
        "live",
        str(path),
        "--estimator",
        "ekf",
        "-o",
        str(tmp_path / "out"),
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.readline()
    return process


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(tmp_path, number):
    process = started(tmp_path)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert all(json.loads(line) for line in out.splitlines())
    (log,) = (tmp_path / "out").glob("*.mcap")
    assert not read_run(log).warnings
    assert replay(log, "ekf", verify=log)


def test_a_reader_that_goes_away_leaves_a_whole_log(tmp_path):
    process = started(tmp_path)
    process.stdout.close()
    process.stdout = None
    _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    (log,) = (tmp_path / "out").glob("*.mcap")
    assert not read_run(log).warnings
