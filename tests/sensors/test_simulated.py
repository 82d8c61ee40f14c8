"""The simulated robot sends what a real one would, and the same for the same seed."""

import math
from dataclasses import replace

import pytest

from fusion import Increment, Odometry, Truth, WheelTicks, WifiScan, WorldError
from fusion.odometry import Odometer
from sensors.scenario import builtin_names, load_scenario
from sensors.simulate import simulate
from sensors.simulated import SimulatedRobot, drive

IDEAL = dict.fromkeys(
    (
        "anchor_offset_std_db",
        "shadowing_std_db",
        "fading_std_db",
        "wall_loss_db",
        "distance_scale_std",
        "track_scale_std",
        "slip_std",
        "gyro_bias_std_rad_s",
        "gyro_noise_std_rad_s",
        "start_std_m",
        "start_heading_std_rad",
    ),
    0.0,
)


def ideal():
    """The office without any error but the rounding of ticks and of dBm."""
    scenario = load_scenario("office")
    return replace(scenario, reality=replace(scenario.reality, **IDEAL))


def test_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path):
    first, again, other = (
        simulate("office", tmp_path / f"{name}.mcap", seed=seed, duration_s=20.0).read_bytes()
        for name, seed in (("first", 1), ("again", 1), ("other", 2))
    )
    assert first == again
    assert first != other


@pytest.mark.parametrize("name", ["office", "mec", "arena"])
def test_builtin_route_stays_inside_its_bounds(name):
    scenario = load_scenario(name)
    bounds = scenario.world.bounds
    assert name in builtin_names()
    for moment in drive(scenario):
        assert bounds.x_min < moment.pose.x < bounds.x_max
        assert bounds.y_min < moment.pose.y < bounds.y_max


def test_ticks_of_an_ideal_robot_integrate_to_the_true_path():
    """A tick is 1.02 cm on a track of 15 cm, so headings are rounded to 4 degrees at any time, but never drift."""
    scenario = ideal()
    robot = SimulatedRobot(scenario)
    odometer = Odometer(scenario.world.robot)
    state, motion, truth = odometer.start(0), Increment(), None
    for message in robot.run():
        if isinstance(message, WheelTicks):
            state, seen = odometer.advance(state, message)
            for odometry in seen:
                assert isinstance(odometry, Odometry)
                motion = motion.extend(odometry, scenario.world.robot.noise)
        elif isinstance(message, Truth):
            truth = message
    start = next(drive(scenario)).pose
    start = start._replace(x=scenario.route.waypoints_m[0][0], y=scenario.route.waypoints_m[0][1])
    assert math.dist(start.compose(motion.pose)[:2], (truth.x, truth.y)) < 1.5


def test_signal_of_an_ideal_radio_is_the_path_loss_model_in_whole_decibels():
    scenario = ideal()
    messages = list(SimulatedRobot(scenario).run())
    truths = {message.time_ns: message for message in messages if isinstance(message, Truth)}
    scans = [message for message in messages if isinstance(message, WifiScan)]
    assert len(scans) > 100
    for scan in scans:
        for reading in scan.readings:
            pose, anchor = truths[scan.time_ns], scenario.world.anchor(reading.anchor)
            away = math.dist((pose.x, pose.y, 0.2), (anchor.x, anchor.y, anchor.z))
            assert abs(reading.rssi_dbm - float(anchor.radio.expected(away))) <= 0.5 + 1e-9


def test_unknown_scenario_is_answered_with_the_nearest():
    with pytest.raises(WorldError, match="did you mean 'office'"):
        load_scenario("offce")
