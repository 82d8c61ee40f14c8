"""Scenarios: the built-in ones stay on their floors, wrong ones are refused with the place and the remedy."""

import itertools
import math

import numpy as np
import pytest

from fusion import WorldError
from logs.reader import read_run
from sensors.simulation.route import drive
from sensors.simulation.scenario import builtin_names, load_scenario
from sensors.simulation.simulate import simulate

SCENARIO = """
[world]
bounds = {x_min = -1.0, x_max = 9.0, y_min = -1.0, y_max = 9.0}
[route]
waypoints_m = [[0.0, 0.0], [2.0, 0.0]]
"""


def crosses(a, b, c, d):
    """Whether the segments a-b and c-d touch, by solving for the point where they meet."""
    directions = np.array([np.subtract(b, a), np.subtract(c, d)]).T
    if abs(np.linalg.det(directions)) < 1e-12:
        return False
    along = np.linalg.solve(directions, np.subtract(c, a))
    return bool(np.all(along >= 0.0) and np.all(along <= 1.0))


def test_builtin_scenarios_are_the_three_of_the_paper_at_its_exponents_and_band():
    names = [name for name in builtin_names() if name.removeprefix("paper_") in ("office", "mec", "arena")]
    assert len(names) == 6
    for name in names:
        exponent = {"office": 2.27, "mec": 2.13, "arena": 1.71}[name.removeprefix("paper_")]
        anchors = load_scenario(name).world.anchors
        assert len(anchors) == 3
        assert {anchor.radio.path_loss_exponent for anchor in anchors} == {exponent}
        assert all(2.4e9 < anchor.radio.frequency_hz < 2.5e9 for anchor in anchors)


@pytest.mark.parametrize("name", builtin_names())
def test_builtin_route_stays_on_the_floor_and_goes_through_no_wall(name):
    scenario = load_scenario(name)
    bounds, walls = scenario.world.bounds, scenario.world.walls
    assert all(
        bounds.x_min < moment.pose.x < bounds.x_max and bounds.y_min < moment.pose.y < bounds.y_max
        for moment in drive(scenario.route)
    )
    legs = itertools.pairwise(scenario.route.waypoints_m)
    sides = [side for wall in walls for side in itertools.pairwise(wall)]
    assert not [(leg, side) for leg in legs for side in sides if crosses(*leg, *side)]


@pytest.mark.parametrize("name", builtin_names())
def test_robot_ends_on_its_last_way_point(name):
    scenario = load_scenario(name)
    *_, last = drive(scenario.route)
    assert math.dist((last.pose.x, last.pose.y), scenario.route.waypoints_m[-1]) < 0.02


@pytest.mark.parametrize("name", ["offce", "ofice", "Office"])
def test_unknown_scenario_is_answered_with_the_nearest(name):
    with pytest.raises(WorldError, match="did you mean 'office'"):
        load_scenario(name)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("speed_m_s = 0.0", "speed_m_s: 0.0 must be greater than zero"),
        ("turn_rate_rad_s = -1.0", "turn_rate_rad_s: -1.0 must be greater than zero"),
        ("laps = 0", "laps: 0 must be greater than zero"),
        ("pause_s = -1.0", "pause_s: -1.0 must not be negative"),
        ("sped_m_s = 0.5", "did you mean 'speed_m_s'"),
        ("[reality]\ngyro_hz = 250.0", "gyro_hz: 250.0 is faster than the virtual clock"),
        ("[reality]\nslip_std = -0.1", "slip_std: -0.1 must not be negative"),
        ("[reality]\nshadowing_length_m = 0.0", "shadowing_length_m"),
        ("[reality]\nwall_loss = 3.0", "did you mean 'wall_loss_db'"),
        ("[truth]\nwall_loss_db = 3.0", "unknown key 'truth'"),
        ("[reality]\nobstruction_share = 1.1", "obstruction_share: 1.1 is more than always"),
        ("[reality]\nscans_at_stop = -1", "scans_at_stop: -1 must not be negative"),
        ("speed_m_s = fast", "not TOML"),
    ],
)
def test_wrong_scenario_is_refused_and_says_where(tmp_path, line, message):
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO + line, encoding="utf-8")
    with pytest.raises(WorldError, match=message) as refusal:
        load_scenario(path)
    assert "mine" in str(refusal.value)


@pytest.mark.parametrize("places", ["[]", "[[1.0, 2.0]]", "[[1.0, 2.0], [1.0, 2.0]]"])
def test_route_that_goes_nowhere_is_refused(tmp_path, places):
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO.replace("[[0.0, 0.0], [2.0, 0.0]]", places), encoding="utf-8")
    with pytest.raises(WorldError, match="two different places"):
        load_scenario(path)


def test_scenario_of_ones_own_is_driven_from_its_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    run = read_run(simulate(path, tmp_path / "mine.mcap"))
    assert run.world.name == "mine"
    assert math.dist((run.truth.x[-1], run.truth.y[-1]), (2.0, 0.0)) < 0.02
