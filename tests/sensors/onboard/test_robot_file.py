"""A robot file is read whole or refused with the place and the remedy."""

import math

import pytest

from fusion import BootClock, FusionError, SettingError
from sensors.onboard.robot_file import RobotFile, Sensor, build_driver
from tests.sensors.robot_files import robot_text


def read(tmp_path, text):
    path = tmp_path / "trolley.toml"
    path.write_text(text)
    return RobotFile.load(path)


def test_a_robot_file_names_its_sensors_and_keeps_its_own_text(tmp_path):
    text = robot_text()
    robot = read(tmp_path, text)
    assert (robot.name, robot.world.name, robot.text) == ("trolley", "room", text)
    assert [sensor.name for sensor in robot.sensors] == ["encoders", "gyro", "motors", "truth", "wifi"]
    assert all(build_driver(sensor, BootClock()).spec.kinds for sensor in robot.sensors)


def test_the_start_says_what_is_known(tmp_path):
    robot = read(tmp_path, robot_text())
    prior = robot.start.prior(7, robot.world)
    assert (prior.time_ns, prior.pose.x, prior.position_known, prior.heading_known) == (7, 1.0, True, True)
    assert math.sqrt(prior.covariance.matrix[2][2]) == pytest.approx(math.radians(5.0))
    unknown = read(tmp_path, robot_text().replace("position_m = [1.0, 1.0]\nheading_deg = 0.0", ""))
    prior = unknown.start.prior(0, unknown.world)
    assert (prior.position_known, prior.heading_known) == (False, False)


def test_a_world_may_stand_in_a_file_beside_it_or_in_the_file_itself(tmp_path):
    hall = '[[anchors]]\nid = "a"\nposition_m = [0, 0]\n'
    (tmp_path / "hall.toml").write_text(hall)
    beside = read(tmp_path, robot_text().replace('"room"', '"hall.toml"', 1))
    within = robot_text().replace('world = "room"\n', "") + hall.replace("anchors", "world.anchors")
    assert [anchor.id for anchor in beside.world.anchors] == ["a"]
    assert [anchor.id for anchor in read(tmp_path, within).world.anchors] == ["a"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("world = ", "word = "), "did you mean 'world'"),
        (("split_s", "splits"), "did you mean 'split_s'"),
        (("min_free_mb = 0.0", "split_s = 0.0"), "must be greater than zero"),
        (("min_free_mb = 0.0", "min_free_mb = -1.0"), "must not be negative"),
        (('name = "gyro"', 'name = "wifi"'), "two are called 'wifi'"),
        (('"room"', '"no_such.toml"'), "no_such.toml"),
        (("[[sensors]]", "[[sensor]]"), "did you mean 'sensors'"),
        (('use = "simulated_gyro"\n', ""), "use is missing"),
        (("[start]", "[start"), "not TOML"),
        (("[start]", "[start]\nposition_std_m = -0.1"), "start.position_std_m: -0.1 must not be negative"),
        (("[start]", "[start]\nheading_std_deg = -1.0"), "start.heading_std_deg: -1.0 must not be negative"),
        (("[start]", "[start]\nposition_std_m = 1e200"), "start: prior: the variance of x is inf"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, change, told):
    text = robot_text(record="min_free_mb = 0.0\nsplit_s = 5.0" if "split_s" in change[0] else "min_free_mb = 0.0")
    with pytest.raises(FusionError, match=told):
        read(tmp_path, text.replace(*change))


def test_a_file_that_is_not_there_is_no_traceback(tmp_path):
    with pytest.raises(SettingError, match="give a robot file"):
        RobotFile.load(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        (Sensor("g", "simulated_gyr"), "did you mean 'simulated_gyro'"),
        (Sensor("g", "simulated_gyro", settings={"senario": "room"}), "did you mean 'scenario'"),
        (Sensor("g", "simulated_gyro", settings={"seed": -1}), "refuses its settings"),
    ],
)
def test_a_driver_that_cannot_be_built_is_named_with_its_sensor(sensor, told):
    with pytest.raises(FusionError, match=told):
        build_driver(sensor, BootClock())
