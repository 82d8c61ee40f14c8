"""The simulated robot sends what a real one would, and the same for the same seed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fusion import Gyro, Increment, MotorCommand, Pose, Ranges, Truth, WheelTicks, WifiScan
from fusion.motion import Integral
from fusion.odometry import Odometer
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.route import drive
from sensors.simulation.scenario import load_scenario

NO_ERRORS = dict.fromkeys(
    [
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
    ],
    0.0,
)
FINE = 1_000_000
"""Ticks a revolution at which rounding to whole ticks no longer matters."""


def with_robot(scenario, **changes):
    return replace(scenario, world=replace(scenario.world, robot=replace(scenario.world.robot, **changes)))


def with_reality(scenario, **changes):
    return replace(scenario, reality=replace(scenario.reality, **changes))


def ideal(name="office", **robot):
    """One lap of a built-in scenario without any error but the rounding of ticks and of dBm."""
    scenario = with_robot(with_reality(load_scenario(name), **NO_ERRORS), **robot)
    return replace(scenario, route=replace(scenario.route, laps=1))


def dead_reckoned(scenario, seed=0):
    """Distance from the truth [m] at every truth of a run, from the true start on odometry alone."""
    robot, errors = scenario.world.robot, []
    odometer, motion = Odometer(robot, 0), Integral(robot.noise, Increment())
    start = Pose(*scenario.route.waypoints_m[0], drive(scenario.route)[0].pose.heading)
    for message in SimulatedRobot(scenario, seed).run():
        if isinstance(message, Truth):
            place = start.compose(motion.increment.pose)
            errors.append(math.dist((place.x, place.y), (message.x, message.y)))
            continue
        if isinstance(message, WifiScan | Ranges):
            odometer.hold(message.time_ns, motion.extend)
        else:
            odometer.advance(message, motion.extend)
    return np.array(errors)


def said_by(scenario, kind, seed=0):
    return [message for message in SimulatedRobot(scenario, seed).run() if isinstance(message, kind)]


@pytest.mark.parametrize("turn_source", ["wheels", "gyro"])
@pytest.mark.parametrize("told", [{}, {"distance_scale": 1.03}, {"diameter_ratio": 1.05}, {"gyro_scale": 1.1}])
def test_odometry_of_a_perfect_robot_is_exact(turn_source, told):
    """What is left is the motion before the first message and the order of turning and driving inside one, 50 ms."""
    scenario = ideal(ticks_per_revolution=FINE, turn_source=turn_source, **told)
    assert dead_reckoned(with_reality(scenario, gyro_hz=100.0)).max() < 0.05


def test_ticks_of_the_papers_robot_do_not_drift():
    """One tick, 1.02 cm on a track of 15 cm, is 4 degrees; but counts are cumulative, and driving on averages it."""
    coarse, fine = dead_reckoned(ideal()).max(), dead_reckoned(ideal(ticks_per_revolution=FINE)).max()
    assert fine < coarse < 0.1


def test_slip_and_wheel_errors_lead_dead_reckoning_astray():
    honest = load_scenario("office")
    for seed in range(2):
        assert 0.3 < dead_reckoned(honest, seed).max() < 12.0


def test_single_channel_encoder_counts_up_only_and_motor_commands_tell_its_direction():
    quadrature = ideal(ticks_per_revolution=FINE)
    scenario = ideal(ticks_per_revolution=FINE, encoder="single_channel")
    counts = np.array([ticks.counts for ticks in said_by(scenario, WheelTicks)])
    assert np.all(np.diff(counts, axis=0) >= 0)
    assert np.any(np.diff([ticks.counts for ticks in said_by(quadrature, WheelTicks)], axis=0) < 0)
    assert not said_by(quadrature, MotorCommand)
    assert dead_reckoned(scenario).max() < 1.0


@pytest.mark.parametrize(("kind", "wheels"), [("differential", 2), ("skid_steer", 4)])
def test_every_wheel_has_its_count(kind, wheels):
    assert {len(ticks.counts) for ticks in said_by(ideal(drive=kind), WheelTicks)} == {wheels}


def test_robot_without_wheels_sends_no_ticks():
    assert not said_by(ideal(drive="none"), WheelTicks)


def test_signal_of_an_ideal_radio_is_the_path_loss_model_in_whole_decibels():
    scenario = ideal()
    truths = {truth.time_ns: truth for truth in said_by(scenario, Truth)}
    away, heard = [], []
    for scan in said_by(scenario, WifiScan):
        truth = truths[scan.time_ns]
        for reading in scan.readings:
            anchor = scenario.world.anchor(reading.anchor)
            away.append(
                math.dist((truth.x, truth.y, scenario.world.robot.antenna_m[2]), (anchor.x, anchor.y, anchor.z))
            )
            heard.append(reading.rssi_dbm)
            assert abs(reading.rssi_dbm - float(anchor.radio.expected(away[-1]))) <= 0.5 + 1e-9
    per_decade = np.polyfit(np.log10(away), heard, 1)[0]
    assert per_decade == pytest.approx(-22.7, abs=0.3)
    assert all(value == round(value) for value in heard)


def test_a_wall_between_takes_the_loss_it_is_said_to_take():
    clear, walled = ideal(), with_reality(ideal(), wall_loss_db=7.0)
    drops = {
        without.rssi_dbm - through.rssi_dbm
        for before, after in zip(said_by(clear, WifiScan), said_by(walled, WifiScan), strict=True)
        for without, through in zip(before.readings, after.readings, strict=True)
    }
    assert {0.0, 7.0} <= drops
    assert all(drop % 7.0 == 0.0 for drop in drops)


def test_shadowing_belongs_to_the_place_and_has_the_spread_it_is_said_to_have():
    """Alike within a step of the robot, unlike across the floor; over many draws of the field 3 dB."""
    scenario = with_reality(ideal(), shadowing_std_db=3.0)
    deviations = []
    for seed in range(6):
        pairs = zip(said_by(scenario, WifiScan, seed), said_by(ideal(), WifiScan), strict=True)
        deviations += [
            [r.rssi_dbm - m.rssi_dbm for r, m in zip(real.readings, model.readings, strict=True)]
            for real, model in pairs
        ]
    values = np.array(deviations)
    assert values.std() == pytest.approx(3.0, rel=0.25)
    assert np.abs(np.diff(values, axis=0)).mean() < 0.5 * values.std()


def test_signals_too_weak_are_not_heard():
    heard = said_by(with_reality(ideal(), deaf_below_dbm=-40.0), WifiScan)
    assert all(reading.rssi_dbm >= -40.0 for scan in heard for reading in scan.readings)
    assert len({len(scan.readings) for scan in heard}) > 1


def test_switching_a_sensor_on_leaves_the_noise_of_the_others_as_it_was():
    scenario = load_scenario("arena")
    others = Gyro | WheelTicks | WifiScan | Truth
    ranging = with_reality(scenario, range_hz=5.0)
    assert said_by(scenario, others) == said_by(ranging, others)
    assert said_by(ranging, Ranges)
    quiet = with_reality(scenario, gyro_hz=0.0)
    assert said_by(scenario, WheelTicks | WifiScan) == said_by(quiet, WheelTicks | WifiScan)


@pytest.mark.parametrize("more", [0, 1])
def test_every_anchor_is_ranged_in_turn_and_walls_only_lengthen(more):
    scenario = with_reality(ideal(), range_hz=5.0, range_std_m=0.0)
    extra = tuple(replace(scenario.world.anchors[0], id=f"extra{i}", x=6.0 + i) for i in range(more))
    scenario = replace(scenario, world=replace(scenario.world, anchors=scenario.world.anchors + extra))
    truths = {truth.time_ns: truth for truth in said_by(scenario, Truth)}
    counts, excesses = {}, []
    for ranges in said_by(scenario, Ranges):
        ((name, range_m, _),) = ranges.readings
        anchor, truth = scenario.world.anchor(name), truths[ranges.time_ns]
        away = math.dist((truth.x, truth.y, scenario.world.robot.antenna_m[2]), (anchor.x, anchor.y, anchor.z))
        excesses.append(range_m - away)
        counts[name] = counts.get(name, 0) + 1
    assert len(counts) == 3 + more
    assert max(counts.values()) - min(counts.values()) <= 1
    assert min(excesses) == pytest.approx(0.0, abs=1e-9)
    assert max(excesses) > 0.3


def stops(scenario):
    return [moment for moment in drive(scenario.route) if moment.leaving]


def test_surveyed_stops_are_one_scan_and_one_truth_at_every_way_point_after_the_first():
    scenario = with_reality(ideal(), scans_at_stop=20, wifi_hz=0.0, truth_hz=0.0)
    scans, truths = said_by(scenario, WifiScan), said_by(scenario, Truth)
    assert [(truth.x, truth.y) for truth in truths] == [
        pytest.approx(place, abs=0.02) for place in scenario.route.waypoints_m[1:]
    ]
    assert (
        [scan.time_ns for scan in scans] == [truth.time_ns for truth in truths] == [s.time_ns for s in stops(scenario)]
    )


def test_averaging_at_a_stop_takes_off_fading_by_the_root_of_the_count():
    """Fading of 4 dB over 25 scans leaves 0.8 dB (rounding to whole dBm adds 0.06)."""
    quiet = with_reality(ideal(), scans_at_stop=25, wifi_hz=0.0)
    noisy = with_reality(quiet, fading_std_db=4.0)
    model = np.array([[float(reading.rssi_dbm) for reading in scan.readings] for scan in said_by(quiet, WifiScan)])
    off = [
        np.array([[reading.rssi_dbm for reading in scan.readings] for scan in said_by(noisy, WifiScan, seed)]) - model
        for seed in range(8)
    ]
    # What an ideal radio says is rounded the same way every time, by up to half a dB: that is no noise.
    assert np.std(off, axis=0).mean() == pytest.approx(0.8, rel=0.1)


@pytest.mark.parametrize(
    ("bias", "distance", "turn"), [("distance_scale_bias", 1.1, 1.1), ("track_scale_bias", 1.0, 1.1)]
)
def test_systematic_wheel_errors_are_the_same_in_every_run(bias, distance, turn):
    """Wheels that roll 10 % further than told tell 10 % more of everything; a track 10 % wider, of turns alone."""
    scenario = with_reality(ideal(ticks_per_revolution=FINE), **{bias: 0.1})
    ends = [said_by(scenario, WheelTicks, seed)[-1].counts for seed in (0, 1)]
    assert ends[0] == ends[1]
    (left, right), (left_told, right_told) = (
        np.array(said_by(each, WheelTicks)[-1].counts)[:2] for each in (ideal(ticks_per_revolution=FINE), scenario)
    )
    assert (left_told + right_told) / (left + right) == pytest.approx(distance, abs=1e-4)
    assert (right_told - left_told) / (right - left) == pytest.approx(turn, abs=1e-3)


def test_gyro_integrates_to_the_heading_plus_the_bias_the_world_tells_however_slow_it_is():
    """Sums of its readings over their period are the true heading at its stamps, turns between two of them included."""
    scenario = with_reality(ideal(gyro_bias_rad_s=0.02), gyro_hz=4.0)
    headings = {moment.time_ns: moment.pose.heading for moment in drive(scenario.route)}
    heading = drive(scenario.route)[0].pose.heading
    for gyro in said_by(scenario, Gyro):
        heading += 0.25 * (gyro.rate_rad_s - 0.02)
        assert math.remainder(heading - headings[gyro.time_ns], math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_obstructions_take_off_what_they_are_said_to_as_often_as_they_are_said_to(share):
    clear = ideal()
    obstructed = with_reality(clear, obstruction_share=share, obstruction_mean_db=5.0)
    losses = np.array(
        [
            before.rssi_dbm - after.rssi_dbm
            for one, other in zip(said_by(clear, WifiScan), said_by(obstructed, WifiScan), strict=True)
            for before, after in zip(one.readings, other.readings, strict=True)
        ]
    )
    assert (losses > 0.0).mean() == pytest.approx(share, abs=0.03)
    if share:
        assert losses[losses > 0.0].mean() == pytest.approx(5.0, rel=0.1)


def test_prior_is_off_by_what_its_covariance_says():
    scenario = load_scenario("office")
    start = Pose(*scenario.route.waypoints_m[0], drive(scenario.route)[0].pose.heading)
    priors = [SimulatedRobot(scenario, seed).prior() for seed in range(200)]
    off = np.array([np.subtract(prior.pose, start) for prior in priors])
    stds = np.sqrt([priors[0].covariance.xx, priors[0].covariance.yy, priors[0].covariance.hh])
    assert np.mean((off / stds) ** 2) == pytest.approx(1.0, abs=0.25)
