"""The doctor names what is wrong with a cure for it; the self-test tells what every sensor said."""

import json
import os

import pytest

from fusion import Advice, DriverSpec, Needs
from fusion.cli.main import main
from fusion.values import Gyro
from sensors.cli import doctor
from sensors.onboard.robot_file import RobotFile, Sensor
from tests.sensors.robot_files import robot_text


@pytest.fixture
def path(tmp_path):
    written = tmp_path / "trolley.toml"
    written.write_text(robot_text())
    return written


class Needy:
    """A driver that needs everything and finds nothing."""

    summary = "needs everything"
    spec = DriverSpec((Gyro,), 1.0, 1.0, Needs(("CAP_NET_ADMIN",), ("no_such_group",), ("no_such_module",)))

    @classmethod
    def discover(cls):
        return []

    def advise(self):
        return [Advice(False, "the radio saves power", "iw dev wlan0 set power_save off")]


def told(found):
    return {advice.what: advice for advice in found}


def test_a_simulated_robot_is_well_but_for_the_computer(path, tmp_path):
    found = doctor.examine(RobotFile.load(path), tmp_path)
    sensors = [advice for advice in found if advice.what.split(":")[0] in ("encoders", "gyro", "wifi")]
    assert len(sensors) == 6
    assert all(advice.is_well for advice in sensors)


def test_what_a_driver_lacks_is_named_with_its_cure(monkeypatch):
    monkeypatch.setattr(doctor, "build_driver", lambda _sensor, _clock: Needy())
    monkeypatch.setattr(doctor, "holds_capability", lambda _: False)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    cures = {advice.what: advice.cure for advice in doctor._sensor(Sensor("g", "needy")) if not advice.is_well}
    assert "fusion-localization[sensors]" in cures["g: the package no_such_module is missing"]
    assert "+net_admin" in cures["g: CAP_NET_ADMIN is not held"]
    assert "usermod -aG no_such_group" in cures["g: you are not in the group no_such_group"]
    assert "g: no such device is present" in cures
    assert cures["the radio saves power"] == "iw dev wlan0 set power_save off"


def test_a_capability_is_read_from_the_kernel(tmp_path, monkeypatch):
    status = tmp_path / "status"
    monkeypatch.setattr(doctor, "STATUS", status)
    status.write_text("Name:\tx\nCapEff:\t0000000000001000\n")
    assert doctor.holds_capability("CAP_NET_ADMIN")
    assert not doctor.holds_capability("CAP_NET_RAW")


def test_a_place_that_cannot_be_written_and_a_slow_disk_are_named(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.touch()
    assert "choose another place" in next(doctor._disk(file, 1.0)).cure
    assert "remove something" in next(doctor._disk(tmp_path, 1e12)).what
    monkeypatch.setattr(doctor, "slowest_sync_s", lambda _: 0.9)
    slow = next(doctor._disk(tmp_path, 0.0))
    assert (slow.is_well, slow.what.endswith("up to 900 ms")) == (False, True)


def test_the_command_exits_by_what_it_found(path, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(doctor, "_clock", lambda: iter(()))
    assert main(["doctor", str(path), "-o", str(tmp_path), "--json"]) == 0
    assert all(row["is_well"] for row in json.loads(capsys.readouterr().out))
    path.write_text(robot_text().replace("simulated_gyro", "simulated_giro"))
    assert main(["doctor", str(path), "-o", str(tmp_path)]) == 1
    text = capsys.readouterr().out
    assert "FIX   gyro" in text
    assert "did you mean 'simulated_gyro'" in text


def test_installed_drivers_and_their_devices_are_listed(capsys):
    assert main(["sensors", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["simulated_gyro"]["devices"][0]["id"] == "simulated"
    assert not [row for row in rows.values() if "error" in row]
    assert main(["sensors"]) == 0
    assert "simulated_wifi: Wi-Fi signal strengths" in capsys.readouterr().out


def test_the_self_test_tells_of_every_sensor(path, tmp_path, capsys):
    report = tmp_path / "report.json"
    assert main(["sensors", "test", str(path), "--seconds", "1.5", "-o", str(report)]) == 0
    rows = {row["name"]: row for row in json.loads(report.read_text())["sensors"]}
    assert rows["gyro"]["interval_s"]["median"] == pytest.approx(0.02)
    assert rows["gyro"]["device"]["settings"]["scenario"] == "room"
    assert rows["gyro"]["messages"] > 40
    assert "gyro: " in capsys.readouterr().out
    path.write_text(robot_text(faults={"wifi": '{ kind = "unplug" }'}))
    assert main(["sensors", "test", str(path), "--seconds", "0.5"]) == 1
    assert main(["sensors", "test", str(path), "--seconds", "0.1", "-o", str(tmp_path)]) == 1
    assert "give another place" in capsys.readouterr().err
