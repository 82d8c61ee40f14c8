"""The simulated robot sends what a real one would, and the same for the same seed."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from fusion import (
    Gyro,
    Increment,
    LogError,
    MotorCommand,
    ParameterError,
    Pose,
    Ranges,
    Truth,
    WheelTicks,
    WifiScan,
    WorldError,
)
from fusion.odometry import Odometer
from logs.reader import read_run
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.route import drive
from sensors.simulation.scenario import builtin_names, load_scenario
from sensors.simulation.simulate import simulate, simulated_run

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
SCENARIO = """
[world]
bounds = {x_min = -1.0, x_max = 9.0, y_min = -1.0, y_max = 9.0}
[route]
waypoints_m = [[0.0, 0.0], [2.0, 0.0]]
"""


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
    odometer, motion, errors = Odometer(scenario.world.robot), Increment(), []
    state = odometer.start(0)
    start = Pose(*scenario.route.waypoints_m[0], drive(scenario.route)[0].pose.heading)
    for message in SimulatedRobot(scenario, seed).run():
        if isinstance(message, Truth):
            place = start.compose(motion.pose)
            errors.append(math.dist((place.x, place.y), (message.x, message.y)))
            continue
        if isinstance(message, WifiScan | Ranges):
            state, steps = odometer.hold(state, message.time_ns)
        else:
            state, steps = odometer.advance(state, message)
        for odometry in steps:
            motion = motion.extend(odometry, scenario.world.robot.noise)
    return np.array(errors)


def said_by(scenario, kind, seed=0):
    return [message for message in SimulatedRobot(scenario, seed).run() if isinstance(message, kind)]


def crosses(a, b, c, d):
    """Whether the segments a-b and c-d touch, by solving for the point where they meet."""
    directions = np.array([np.subtract(b, a), np.subtract(c, d)]).T
    if abs(np.linalg.det(directions)) < 1e-12:
        return False
    along = np.linalg.solve(directions, np.subtract(c, a))
    return bool(np.all(along >= 0.0) and np.all(along <= 1.0))


def test_same_seed_gives_the_same_bytes_and_another_seed_others(tmp_path):
    first, again, other = (
        simulate("office", tmp_path / f"{name}.mcap", seed=seed, duration_s=20.0).read_bytes()
        for name, seed in (("first", 1), ("again", 1), ("other", 2))
    )
    assert first == again
    assert first != other


def test_log_says_what_the_robot_said(tmp_path):
    scenario = load_scenario("mec")
    run = read_run(simulate("mec", tmp_path / "mec.mcap", seed=4, duration_s=10.0))
    said = [message for message in SimulatedRobot(scenario, 4).run() if message.time_ns <= 10_000_000_000]
    assert run.measurements == tuple(message for message in said if not isinstance(message, Truth))
    assert len(run.truth) == sum(isinstance(message, Truth) for message in said)
    assert run.world == scenario.world
    assert run.measurements[-1].time_ns <= 10_000_000_000


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


def test_a_run_in_memory_is_the_run_in_its_log(tmp_path):
    logged, held = read_run(simulate("mec", tmp_path / "mec.mcap", seed=4)), simulated_run(load_scenario("mec"), 4)
    assert held.measurements == logged.measurements
    assert (held.name, held.world, held.prior) == (logged.name, logged.world, logged.prior)
    for column in ("time_ns", "x", "y"):
        assert np.array_equal(getattr(held.truth, column), getattr(logged.truth, column))
    # Logs hold headings as quaternions, which round.
    assert held.truth.heading == pytest.approx(logged.truth.heading, abs=1e-12)


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


@pytest.mark.parametrize(
    "wrong", [{"seed": -1}, {"duration_s": math.nan}, {"duration_s": math.inf}, {"duration_s": 0.0}]
)
def test_seed_or_duration_without_a_meaning_is_refused_before_anything_is_written(tmp_path, wrong):
    with pytest.raises(ParameterError):
        simulate("office", tmp_path / "run.mcap", **wrong)
    assert not list(tmp_path.iterdir())


def test_output_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(LogError, match="cannot be written"):
        simulate("office", tmp_path, duration_s=1.0)
