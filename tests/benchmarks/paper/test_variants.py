"""One run in other forms is still the same run."""

import json
import math

import numpy as np
import pytest

from benchmarks.paper.interpretation_study import literal_of_scale
from benchmarks.paper.interpretations import INTERPRETATIONS, OPTIONS, SCALES, literal
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, PROPOSED, WIFI
from benchmarks.paper.trial import point_errors
from benchmarks.paper.variants import MISSING_SHARE, leg_by_leg, missing_wifi, moved_by, with_gyro, without_gyro
from benchmarks.runner.estimator_run import run_estimator
from fusion import Gyro, Odometry, WifiScan
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulated_run

SCENARIOS = [environment.scenario for environment in ENVIRONMENTS]


def plain(scenario="paper_office", seed=3):
    return without_gyro(simulated_run(load_scenario(scenario), seed))


def errors(run, estimator, **options):
    return point_errors(run, run_estimator(run, estimator, options).track)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_robot_drives_to_as_many_trial_points_as_the_paper_and_scans_at_each(scenario):
    run = plain(scenario)
    points = {environment.scenario: environment.trial_points for environment in ENVIRONMENTS}[scenario]
    scans = [item for item in run.measurements if isinstance(item, WifiScan)]
    assert len(run.truth) == len(scans) == points
    assert {len(scan.readings) for scan in scans} == {3}
    exponent = {environment.scenario: environment.path_loss_exponent for environment in ENVIRONMENTS}[scenario]
    assert {anchor.radio.path_loss_exponent for anchor in run.world.anchors} == {exponent}


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("estimator", [ODOMETRY, WIFI, PROPOSED])
def test_leg_by_leg_is_the_same_run_and_far_shorter(scenario, estimator):
    run = plain(scenario)
    brief = leg_by_leg(run)
    assert len(brief.measurements) == 4 * len(run.truth)
    assert errors(brief, estimator) == pytest.approx(errors(run, estimator), abs=1e-6)


def test_leg_by_leg_knows_the_distance_travelled_to_the_drift_of_the_legs():
    for scale in SCALES:
        run = plain("paper_arena")
        whole = errors(run, PROPOSED, outlier_relative_to=scale)
        assert errors(leg_by_leg(run), PROPOSED, outlier_relative_to=scale) == pytest.approx(whole, abs=1e-6)


@pytest.mark.parametrize("offset_m", [None, 100.0])
@pytest.mark.parametrize("scale", ["travelled", "floor"])
def test_moved_map_changes_nothing_for_interpretations_without_an_origin(offset_m, scale):
    run = plain()
    moved = errors(moved_by(run, offset_m), PROPOSED, outlier_relative_to=scale)
    assert moved == pytest.approx(errors(run, PROPOSED, outlier_relative_to=scale), abs=1e-6)


def test_middle_of_the_floor_becomes_the_origin():
    bounds = moved_by(plain(), None).world.bounds
    assert (bounds.x_min, bounds.y_min) == (-bounds.x_max, -bounds.y_max)


def test_gyro_is_there_or_not_and_the_world_states_which():
    whole = simulated_run(load_scenario("paper_office"), 0)
    assert any(isinstance(item, Gyro) for item in whole.measurements)
    assert not any(isinstance(item, Gyro) for item in without_gyro(whole).measurements)
    aided = with_gyro(whole, load_scenario("paper_office").reality)
    assert aided.measurements == whole.measurements
    assert json.loads(aided.world.table)["robot"]["turn_source"] == "gyro"
    # 0.01 rad/s a tenth of a second: an angle random walk of 0.00316 rad per root second.
    assert aided.world.robot.noise.turn_std_per_sqrt_s == pytest.approx(0.01 / math.sqrt(10.0))


def test_missing_wifi_takes_one_reading_from_a_fifth_of_the_scans_and_nothing_else():
    run, hit, total = plain("paper_arena"), 0, 0
    for seed in range(40):
        for before, after in zip(run.measurements, missing_wifi(run, seed).measurements, strict=True):
            if isinstance(before, WifiScan):
                total += 1
                hit += before != after
                assert set(after.readings) <= set(before.readings)
                assert len(after.readings) >= len(before.readings) - 1
            else:
                assert after == before
    assert hit / total == pytest.approx(MISSING_SHARE, abs=4.0 * math.sqrt(0.2 * 0.8 / total))


def test_interpretations_are_all_combinations_once_and_the_defaults_are_one_of_them():
    assert len(set(INTERPRETATIONS)) == len(INTERPRETATIONS) == np.prod([len(values) for values in OPTIONS.values()])
    assert literal() in INTERPRETATIONS
    assert INTERPRETATIONS[literal_of_scale("coordinate")] == literal()
    assert INTERPRETATIONS[literal_of_scale("floor")].options == {**literal().options, "outlier_relative_to": "floor"}


def test_odometry_increments_of_a_leg_are_turn_straight_turn():
    first = [item for item in leg_by_leg(plain()).measurements if isinstance(item, Odometry)][:3]
    assert [item.distance_m == 0.0 for item in first] == [True, False, True]
    assert [item.turn_rad == 0.0 for item in first][1]
    assert first[0].time_ns == first[1].from_ns
