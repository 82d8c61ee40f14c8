"""A recording holds what every sensor said, whatever happens to sensors, disk and program."""

import json
import os
import re
import signal
import subprocess
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest

from fusion import LogError, NotFoundError
from fusion.cli.main import main
from fusion.values import Gyro, WheelTicks, WifiScan
from logs.cli.join import join
from logs.reader import read_run
from sensors.onboard import rolling_log
from sensors.onboard.recorder import record
from tests.sensors.robot_files import robot_text


def recorded(robot, folder, duration_s, **options):
    return record(robot, folder, stop=threading.Event(), duration_s=duration_s, **options)


def test_everything_the_sensors_said_is_in_the_log(robot, tmp_path):
    done = recorded(robot(), tmp_path / "out", 2.5)
    run = read_run(done.paths[0])
    kinds = {kind: [m for m in run.measurements if isinstance(m, kind)] for kind in (WheelTicks, Gyro, WifiScan)}
    said = {status.name: status.messages for status in done.statuses}
    assert said["gyro"] == len(kinds[Gyro]) >= 100
    assert said["encoders"] == len(kinds[WheelTicks]) >= 40
    assert said["wifi"] == len(kinds[WifiScan]) >= 4
    assert said["truth"] == len(run.truth)
    assert run.prior is not None
    assert done.trouble == ""
    assert not run.warnings


def test_the_log_tells_of_devices_clocks_and_how_sensors_do(robot, tmp_path):
    run = read_run(recorded(robot(), tmp_path / "out", 1.5).paths[0])
    opened = {
        diagnostic.sensor: dict(diagnostic.values) for diagnostic in run.diagnostics if diagnostic.text == "opened"
    }
    assert json.loads(opened["gyro"]["settings"])["scenario"] == "room"
    status = [
        dict(diagnostic.values)
        for diagnostic in run.diagnostics
        if diagnostic.text == "status" and diagnostic.sensor == "gyro"
    ]
    assert [row["state"] for row in status] == ["running"] * len(status)
    assert len(status) >= 2
    assert abs(run.clocks[0].real_ns - time.time_ns()) < 600e9
    assert run.metadata["clock"] == "CLOCK_BOOTTIME"


def test_splits_are_whole_logs_and_become_one_again(robot, tmp_path):
    done = recorded(robot(record="min_free_mb = 0.0\nsplit_s = 1.0"), tmp_path / "out", 3.3)
    parts = [read_run(path) for path in done.paths]
    assert len(parts) >= 3
    assert not parts[0].warnings
    assert all("`fusion join`" in warning for part in parts for warning in part.warnings)
    assert len({part.world.hash for part in parts}) == 1
    assert all(part.clocks for part in parts)
    assert all({r.sensor for r in part.diagnostics if r.text == "opened"} >= {"gyro", "wifi"} for part in parts)
    assert [part.prior is not None for part in parts] == [True] + [False] * (len(parts) - 1)
    assert join([tmp_path / "out"], tmp_path / "whole.mcap") == ()
    whole = read_run(tmp_path / "whole.mcap")
    assert list(whole.measurements) == [m for part in parts for m in part.measurements]
    assert whole.prior == parts[0].prior
    assert not whole.warnings
    assert len(whole.diagnostics) == sum(len(part.diagnostics) for part in parts)


def test_joining_names_what_is_missing_and_refuses_what_does_not_belong(robot, tmp_path):
    one = robot(record="min_free_mb = 0.0\nsplit_s = 1.0")
    done = recorded(one, tmp_path / "out", 2.6)
    other = recorded(one, tmp_path / "out", 0.3)
    first, second, *_ = done.paths
    assert not set(done.paths) & set(other.paths)
    second.unlink()
    assert "part 1 is missing" in join(done.paths[:1] + done.paths[2:], tmp_path / "gap.mcap")[0]
    with pytest.raises(LogError, match="2 recordings"):
        join([tmp_path / "out"], tmp_path / "two.mcap")
    with pytest.raises(LogError, match="there already"):
        join([first], tmp_path / "gap.mcap")
    with pytest.raises(LogError, match="give it once"):
        join([first, first], tmp_path / "twice.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="no log is there"):
        join([tmp_path / "empty"], tmp_path / "none.mcap")


def test_a_sensor_that_is_unplugged_costs_itself_alone(robot, tmp_path):
    faults = {"wifi": '{ kind = "unplug", from_s = 0.6, to_s = 1.4 }'}
    run = read_run(recorded(robot(faults=faults), tmp_path / "out", 3.0).paths[0])
    told = [
        diagnostic for diagnostic in run.diagnostics if diagnostic.sensor == "wifi" and "unplugged" in diagnostic.text
    ]
    told += [diagnostic for diagnostic in run.diagnostics if diagnostic.sensor == "wifi" and "gone" in diagnostic.text]
    assert told
    gyro = [m.time_ns for m in run.measurements if isinstance(m, Gyro)]
    assert max(b - a for a, b in pairwise(gyro)) < 0.5e9
    assert [m for m in run.measurements if isinstance(m, WifiScan)][-1].time_ns > gyro[0] + 2.0e9


def test_a_required_sensor_that_is_missing_refuses_to_start_unless_told(robot, tmp_path):
    gone = {"wifi": '{ kind = "unplug" }'}
    with pytest.raises(NotFoundError, match=r"wifi: .*unplugged.*--degraded"):
        recorded(robot(faults=gone), tmp_path / "out", 0.5, patience_s=0.3)
    assert not list((tmp_path / "out").glob("*.mcap"))
    assert recorded(robot(faults=gone), tmp_path / "out", 0.5, degraded=True).trouble == ""
    optional = robot(faults=gone, required={"wifi": False})
    assert recorded(optional, tmp_path / "out", 0.5, patience_s=0.3).trouble == ""


def test_failing_fast_ends_with_the_reason(robot, tmp_path):
    faults = {"gyro": '{ kind = "unplug", from_s = 0.5 }'}
    done = recorded(robot(faults=faults), tmp_path / "out", 30.0, fail_fast=True)
    assert "gyro" in done.trouble
    assert done.duration_s < 20.0


def test_a_disk_that_fills_up_ends_the_recording_cleanly(robot, tmp_path, monkeypatch):
    full = threading.Event()
    monkeypatch.setattr(rolling_log, "free_bytes", lambda _: 1e6 if full.is_set() else 1e12)
    done = recorded(robot(record="min_free_mb = 100.0"), tmp_path / "out", 60.0, on_status=lambda *_: full.set())
    assert "nearly full: 99 MB less" in done.trouble
    assert not read_run(done.paths[0]).warnings
    with pytest.raises(LogError, match="remove something"):
        recorded(robot(record="min_free_mb = 100.0"), tmp_path / "out", 1.0)


def test_a_ring_gives_up_the_oldest_files_of_its_robot_only(robot, tmp_path, monkeypatch):
    folder = tmp_path / "out"
    folder.mkdir()
    for age, name in enumerate(
        ("trolley-aaaaaaaa-0000.mcap", "other-aaaaaaaa-0000.mcap", "trolley-aaaaaaaa-0001.mcap")
    ):
        (folder / name).write_bytes(b"x")
        os.utime(folder / name, ns=(age, age))
    monkeypatch.setattr(rolling_log, "free_bytes", lambda _: 1e9 if len(list(folder.iterdir())) <= 3 else 0)
    done = recorded(robot(record="min_free_mb = 100.0\nring = true"), folder, 0.5)
    assert done.trouble == ""
    assert not (folder / "trolley-aaaaaaaa-0000.mcap").exists()
    assert (folder / "other-aaaaaaaa-0000.mcap").exists()
    assert (folder / "trolley-aaaaaaaa-0001.mcap").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a tmpfs needs root")
def test_a_disk_that_is_full_all_the_same_loses_nothing_that_is_on_it(tmp_path, start_recording):
    small = tmp_path / "out"
    small.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(small)], check=False)
    if mounted.returncode:
        pytest.skip("this machine mounts no tmpfs")
    try:
        process = start_recording("--min-free", "0", "--duration", "60")
        _, err = process.communicate(timeout=120)
        assert process.returncode == 1
        assert "free some space" in err
        run = read_run(next(small.glob("*.mcap")))
        assert len(run.measurements) > 100
    finally:
        subprocess.run(["umount", str(small)], check=True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_gives_a_whole_file(start_recording, number):
    process = start_recording()
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 0, err
    run = read_run(Path(out.split()[-1]))
    assert not run.warnings
    assert run.measurements


def test_the_service_manager_hears_that_it_is_ready_alive_and_stopping(tmp_path, start_recording, monkeypatch):
    import socket

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(20.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        process = start_recording("--duration", "1.5")
        process.communicate(timeout=30)
        heard = [manager.recv(100)]
        while heard[-1] != b"STOPPING=1":
            heard.append(manager.recv(100))
    assert heard[0] == b"READY=1"
    assert b"WATCHDOG=1" in heard
    assert heard[-1] == b"STOPPING=1"


def test_the_command_says_what_is_wrong_in_one_sentence(tmp_path, capsys):
    path = tmp_path / "trolley.toml"
    path.write_text(robot_text().replace("simulated_gyro", "simulated_giro"))
    assert main(["record", str(path), "-o", str(tmp_path / "out")]) == 1
    assert "did you mean 'simulated_gyro'" in capsys.readouterr().err
    path.write_text(robot_text())
    assert main(["record", str(path), "-o", str(path)]) == 1
    assert "choose another place" in capsys.readouterr().err
    assert main(["record", str(path), "-o", str(tmp_path / "out"), "--duration", "nan"]) == 1
    assert "leave it out" in capsys.readouterr().err
    assert main(["record", str(path), "-o", str(tmp_path / "out"), "--duration", "0.6", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert re.search(r"trolley-\w{8}-0000\.mcap", told["paths"][0])
