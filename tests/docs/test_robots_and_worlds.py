"""Each robot file and each world of the docs is driven: recorded, or its drivers opened on their stand-in devices."""

import ast
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

import fusion
from benchmarks.review.folding import Reviewed
from benchmarks.runner.adhoc_suite import bench
from benchmarks.runner.estimator_run import run_estimator
from fusion import Truth, World
from fusion.driver import Diagnostic
from fusion.plugins import SENSORS
from logs.reader import read_run
from sensors.cli import doctor
from sensors.onboard.robot_file import RobotFile, Sensor, build_driver
from sensors.onboard.sensor_loop import SensorLoop
from sensors.simulation.scenario import Scenario
from sensors.simulation.simulate import simulated_run
from tests.sensors.virtual_drive import virtual_drive

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
KINDS = {
    "sensors": "a robot file, or some of its sensors",
    "anchors": "a world",
    "peers": "settings of the driver wifi_rtt",
    "suite": "a suite: test_docs_are_true.py",
    "project": "entry points of a package",
}
PLACES = ("device", "path", "port", "sysfs")
"""Settings that lead to the device: of these, those of the stand-in count."""
WITHOUT_WORLD = 'world = "room"\n'
MOST_RMSE_M, MOST_ANEES = 0.7, 3.0
"""Of `ekf` on what the robots of the docs record in `room`: it errs by 0.4 m and its ANEES is 1."""


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def texts_in_python(page):
    """The strings of several lines in the Python of a page."""
    trees = map(ast.parse, blocks(page, "python"))
    constants = (node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return [text for text in constants if isinstance(text, str) and "\n" in text]


def printed():
    """Each TOML text of the docs, by its page and place."""
    for page in PAGES:
        for place, text in enumerate([*blocks(page, "toml"), *texts_in_python(page)]):
            yield pytest.param(text, id=f"{page.name}-{place}")


def of_kind(kind, *, whole=None):
    """Those that hold ``kind``; of robots only those that are whole, with a world, or are not."""
    return [
        one
        for one in printed()
        if kind in (table := tomllib.loads(one.values[0])) and (whole is None or ("world" in table) is whole)
    ]


def robot_file(folder, text):
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return RobotFile.load(path)


def with_truth(robot):
    """The robot, with a sensor of its true pose if it has none."""
    if any(sensor.use == "simulated_tracker" for sensor in robot.sensors):
        return robot
    tracker = Sensor("truth", "simulated_tracker", settings={"scenario": robot.sensors[0].settings["scenario"]})
    return replace(robot, sensors=(*robot.sensors, tracker))


def scored(robot, folder):
    """RMSE [m] and ANEES of `ekf` on a whole drive of a robot."""
    (score,) = bench(virtual_drive(with_truth(robot), folder, 30.0), estimators=["ekf"], workers=1)
    assert score.status == "ok"
    return score.metrics["pos_rmse"], score.metrics["anees"]


def test_every_toml_text_of_the_docs_is_of_a_kind_that_is_tried():
    for one in printed():
        assert len(KINDS.keys() & tomllib.loads(one.values[0]).keys()) == 1, one.id
    assert [one.id for one in of_kind("sensors", whole=True)] == ["record.md-0", "robot.md-0"]
    assert [one.id for one in of_kind("anchors")] == ["world.md-0"]


@pytest.mark.parametrize("text", of_kind("sensors", whole=True))
def test_robot_file_of_the_docs_records_what_an_estimator_can_use(text, tmp_path):
    robot = robot_file(tmp_path, text)
    assert SensorLoop(robot).warning == ""
    names = {sensor.name for sensor in robot.sensors}
    found = [advice for advice in doctor.examine(robot, tmp_path) if advice.what.split(":")[0] in names]
    assert len(found) == 2 * len(names)
    assert all(advice.is_well for advice in found)
    rmse_m, anees = scored(robot, tmp_path / "out")
    assert rmse_m < MOST_RMSE_M
    assert anees < MOST_ANEES
    (path,) = (tmp_path / "out").glob("*.mcap")
    run = read_run(path)
    assert run.warnings == ()
    assert {measurement.sensor for measurement in run.measurements} == {
        sensor.name for sensor in robot.sensors if sensor.use != "simulated_tracker"
    }


def test_the_bound_finds_a_robot_file_that_goes_wrong(tmp_path):
    """The fault that the docs had: encoders of a single channel, and no motor commands."""
    robot = robot_file(tmp_path, of_kind("sensors", whole=True)[0].values[0])
    without = replace(robot, sensors=tuple(one for one in robot.sensors if one.use != "simulated_motors"))
    rmse_m, anees = scored(without, tmp_path / "out")
    assert rmse_m > 3.0 * MOST_RMSE_M
    assert anees > 10.0 * MOST_ANEES


def parts():
    """The sensors that stand alone on the pages of the drivers, and the settings that stand alone."""
    yield from ((f"{WITHOUT_WORLD}{one.values[0]}", one.id) for one in of_kind("sensors", whole=False))
    for one in of_kind("peers"):
        yield f'{WITHOUT_WORLD}[[sensors]]\nname = "rtt"\nuse = "wifi_rtt"\n[sensors.settings]\n{one.values[0]}', one.id


@pytest.mark.parametrize("text", [pytest.param(text, id=name) for text, name in parts()])
def test_sensors_on_the_page_of_a_driver_measure_on_the_stand_in_for_their_device(text, tmp_path):
    robot = robot_file(tmp_path, text)
    SensorLoop(robot)
    for sensor in robot.sensors:
        with fusion.load(sensor.use, SENSORS).fake() as device:
            places = {key: value for key, value in device.settings.items() if key in PLACES}
            driver = build_driver(replace(sensor, settings={**sensor.settings, **places}), device.clock)
            try:
                driver.open()
                device.speak()
                assert measured(driver), sensor.name
            finally:
                driver.close()


def measured(driver):
    """The first measurement of a driver."""
    for _ in range(100):
        for said in driver.poll(0.05):
            if not isinstance(said, Diagnostic | Truth):
                return said
    return None


@pytest.mark.parametrize("text", of_kind("anchors"))
def test_a_robot_driven_in_a_world_of_the_docs_is_found(text):
    """Around its floor, half a metre from the bounds."""
    bounds = World.from_toml(text).bounds
    corners = [[x, y] for x in (bounds.x_min, bounds.x_max) for y in (bounds.y_min, bounds.y_max)]
    middle = 0.5 * (bounds.x_min + bounds.x_max), 0.5 * (bounds.y_min + bounds.y_max)
    inside = [[p + (0.5 if p < m else -0.5) for p, m in zip(corner, middle, strict=True)] for corner in corners]
    route = {"waypoints_m": [inside[k] for k in (0, 2, 3, 1, 0)]}
    table = {"world": tomllib.loads(text), "route": route, "reality": {"range_hz": 5.0}}
    run = simulated_run(Scenario.from_table("docs", table), 0)
    score = Reviewed.of(run, run_estimator(run, "ekf")).score
    assert score.metrics["pos_rmse"] < 0.3
    assert score.metrics["anees"] < MOST_ANEES


def test_what_the_page_of_the_world_file_shows_beside_it_belongs_to_it():
    """The table that a calibration leaves behind, and walls, which stand above the first table."""
    page = ROOT / "docs" / "world.md"
    (text,), (calibration,) = blocks(page, "toml"), blocks(page, "text")
    (walls,) = re.findall(r"`(walls = .*?)`", page.read_text(encoding="utf-8"))
    world = World.from_toml(f"{walls}\n{text}\n{calibration}")
    assert world.walls
    assert world.calibration["radio"].samples == 412
