"""From drivers to scores: a robot is driven in the guest, `fusion record` records it there with real drivers on the
kernel's own devices, and `fusion bench` scores estimators on that recording here.
"""

import itertools
import json
import math
import signal

import pytest

from fusion import Truth
from fusion.cli.main import main
from fusion.values import Gyro, MotorCommand, Ranges, WheelTicks, WifiScan
from kernel import boot
from logs.message_stream import Walk
from logs.reader import read_run
from logs.writer import RunWriter

pytestmark = [pytest.mark.kernel, pytest.mark.usefixtures("gpio")]

ACCURATE_M = 0.25
"""For ranges of 0.1 m standard deviation and a start known to 5 cm; a robot taken to stand still is 2.4 m off."""

LIMIT_S = 580.0
"""On a busy host the guest's time is slow."""
HALF_A_PERIOD_NS = 50_000_000
"""Of the encoders, which report ten times a second: what is held up must not look like speed."""
SOME_IS_LOST = 3
"""How `fusion repair` ends where the file it wrote lacks something, here the last second."""


@pytest.fixture(scope="module")
def driven(machine, first_files, tmp_path_factory):
    """One guest for all that is asked of its two recordings."""
    share = tmp_path_factory.mktemp("drive")
    job, asked = "record_drive", {"seed": 1, "killed_after_bytes": 25_000}
    return boot.run(machine, first_files, share, job, limit_s=LIMIT_S, clock=boot.COUNTED, **asked)


def recording(driven, folder):
    """The one file of a recording."""
    (path,) = (driven.folder / folder).glob("*.mcap")
    return path


def with_truth(recorded, truth, target):
    """A copy of a recording that knows where the robot really was."""
    run = read_run(recorded)
    with RunWriter(target, run.world, name="kernel", metadata=run.metadata) as log:
        for source, message in Walk(recorded):
            log.copy(source.topic, source.type, message)
        for row in truth:
            log.write_truth(Truth(*row))
    return target


def test_every_real_driver_is_in_the_recording_and_no_tick_is_lost(driven):
    run = read_run(recording(driven, "whole"))
    kinds = WheelTicks, Gyro, Ranges, WifiScan
    heard = {kind: [m for m in run.measurements if isinstance(m, kind)] for kind in kinds}
    assert driven.answer["ended"][0] == 0
    assert not run.warnings
    assert {m.sensor for m in run.measurements} == {"encoders", "motors", "gyro", "uwb", "wifi"}
    assert list(heard[WheelTicks][-1].counts) == driven.answer["ticks"]
    reports_ns = [ticks.time_ns for ticks in heard[WheelTicks]]
    assert min(now - before for before, now in itertools.pairwise(reports_ns)) >= HALF_A_PERIOD_NS
    assert len(heard[Ranges]) > 250
    assert len(heard[Gyro]) > 400
    assert {one.anchor for scan in heard[WifiScan] for one in scan.readings} == {"ap1", "ap2", "ap3"}
    assert [m.wheel_speeds_m_s[0] > 0.0 for m in run.measurements if isinstance(m, MotorCommand)].count(True) >= 4
    models = {
        diagnostic.sensor: dict(diagnostic.values)["model"]
        for diagnostic in run.diagnostics
        if diagnostic.text == "opened"
    }
    assert models["gyro"] == "MPU-6050"


def test_the_ekf_tracks_the_robot_from_what_the_drivers_recorded(driven, tmp_path, capsys):
    truth = driven.answer["truth"]
    log, scores = with_truth(recording(driven, "whole"), truth, tmp_path / "run.mcap"), tmp_path / "scores.json"
    assert main(["info", str(log)]) == 0
    assert main(["bench", str(log), "--workers", "1", "--json", str(scores)]) == 0
    with capsys.disabled():
        print(f"\n{capsys.readouterr().out}devices late: {driven.answer['late']} s")
    score = {row["estimator"]: row for row in json.loads(scores.read_text())}
    _, x, y, _ = truth[0]
    standing_m = math.sqrt(sum((row[1] - x) ** 2 + (row[2] - y) ** 2 for row in truth) / len(truth))
    assert standing_m > 1.5
    assert score["ekf"]["status"] == "ok"
    assert score["ekf"]["pos_rmse"] < ACCURATE_M
    assert score["ekf"]["pos_rmse"] < score["dead_reckoning"]["pos_rmse"] < standing_m
    assert score["ekf"]["head_rmse"] < 0.25
    assert score["ekf"]["fates"]["used"] > 40


def test_a_recorder_that_was_killed_leaves_a_log_that_can_be_repaired(driven, tmp_path):
    broken, good = recording(driven, "killed"), tmp_path / "good.mcap"
    assert driven.answer["ended"][1] == -signal.SIGKILL
    assert read_run(broken).warnings
    assert main(["repair", str(broken), "-o", str(good)]) == SOME_IS_LOST
    run = read_run(good)
    assert {m.sensor for m in run.measurements} >= {"encoders", "gyro"}
    assert [list(m.counts) for m in run.measurements if isinstance(m, WheelTicks)][-1] == [0, 0, 0, 0]
