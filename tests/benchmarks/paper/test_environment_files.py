"""Numbers that the paper does not give: filled in, stated in the world, solved for without the proposed method."""

import tomllib

import numpy as np
import pytest

from benchmarks.metrics.matching import match
from benchmarks.metrics.score import errors as score
from benchmarks.paper import environment_files, fit_environments
from benchmarks.paper.assumptions import ALTERNATIVES, MAIN, filled
from benchmarks.paper.environment_files import (
    ALTERNATIVES_FILE,
    calibrated_alternative,
    calibrated_numbers,
    write_calibrated,
)
from benchmarks.paper.fit_environments import SEEDS, Solved, Unknown, solve, unknowns
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, PROPOSED, WIFI
from benchmarks.paper.variants import without_gyro
from benchmarks.runner.estimator_run import run_estimator
from fusion import FusionError, WifiScan, WorldError
from logs.truth import evaluation_instants
from sensors.simulation.scenario import Scenario, load_scenario, scenario_text
from sensors.simulation.simulate import simulated_run

OFFICE = ENVIRONMENTS[0]
OBSTRUCTIONS = ALTERNATIVES[-1]


def table(environment=OFFICE):
    return tomllib.loads(scenario_text(environment.scenario))


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_builtin_scenario_is_the_main_filling_at_its_own_calibration(environment):
    """So what calibration wrote is what runs: nothing was changed by hand afterwards."""
    stored = table(environment)
    numbers = stored["calibration"]
    assert filled(stored, MAIN, numbers["odometry_factor"], numbers["shadowing_std_db"]) == stored
    assert numbers["odometry_max_reached_m"] == pytest.approx(environment.odometry_max_m, rel=0.02)
    assert numbers["wifi_max_reached_m"] == pytest.approx(environment.wifi_max_m, rel=0.02)
    assert numbers["seeds"] == [SEEDS.start, SEEDS.stop - 1]


@pytest.mark.parametrize("environment", ENVIRONMENTS)
@pytest.mark.parametrize("filling", ALTERNATIVES, ids=lambda filling: filling.key)
def test_every_other_filling_was_calibrated_too(environment, filling):
    numbers = calibrated_numbers(environment, filling)
    assert numbers["odometry_max_reached_m"] == pytest.approx(environment.odometry_max_m, rel=0.02)
    assert numbers["wifi_max_reached_m"] == pytest.approx(environment.wifi_max_m, rel=0.02)
    assert isinstance(calibrated_alternative(environment, filling), Scenario)


def test_half_the_floor_is_the_same_floor_at_half_the_size():
    small = Scenario.from_table("small", filled(table(), ALTERNATIVES[0], 1.0, 1.0))
    whole = load_scenario(OFFICE.scenario)
    assert np.array(small.route.waypoints_m) == pytest.approx(0.5 * np.array(whole.route.waypoints_m))
    for half, full in zip(small.world.anchors, whole.world.anchors, strict=True):
        assert (half.x, half.y) == pytest.approx((0.5 * full.x, 0.5 * full.y))
    assert small.world.bounds.x_max == 0.5 * whole.world.bounds.x_max


@pytest.mark.parametrize(("filling", "wifi_db"), [(MAIN, 2.0), (OBSTRUCTIONS, 5.0)])
def test_stated_spread_of_signal_strengths_is_the_true_one(filling, wifi_db):
    scenario = Scenario.from_table("stated", filled(table(), filling, 1.0, wifi_db))
    off = []
    for seed in range(120):
        run = simulated_run(scenario, seed)
        truth = {int(t): (x, y) for t, x, y in zip(run.truth.time_ns, run.truth.x, run.truth.y, strict=True)}
        for scan in run.measurements:
            if isinstance(scan, WifiScan):
                for reading in scan.readings:
                    anchor = run.world.anchor(reading.anchor)
                    away = np.hypot(*np.subtract(truth[scan.time_ns], (anchor.x, anchor.y)))
                    off.append(reading.rssi_dbm - float(anchor.radio.expected(away)))
    assert np.std(off) == pytest.approx(scenario.world.anchors[0].radio.std, rel=0.1)


@pytest.mark.parametrize("environment", ENVIRONMENTS, ids=lambda environment: environment.short)
def test_stated_odometry_noise_covers_the_errors_behind_it(environment):
    """Dead reckoning on the main filling: its claimed covariance is neither a tenth nor ten times its errors."""
    scenario, nees = load_scenario(environment.scenario), []
    for seed in range(12):
        run = without_gyro(simulated_run(scenario, seed))
        instants = evaluation_instants(run.truth)
        nees.append(score(instants, match(instants, run_estimator(run, ODOMETRY).track)).nees_2d)
    assert 0.2 < np.mean(nees) / 2.0 < 5.0


def test_solution_meets_its_target_and_comes_again():
    task = (Unknown(OFFICE, MAIN, WIFI), table(), range(SEEDS.start, SEEDS.start + 15))
    found = solve(task)
    assert found.reached_m == pytest.approx(OFFICE.wifi_max_m, rel=0.03)
    assert solve(task) == found


def test_what_cannot_be_solved_is_refused_with_a_remedy(monkeypatch):
    monkeypatch.setitem(fit_environments.BRACKETS, WIFI, (0.01, 0.02))
    with pytest.raises(FusionError, match=r"office, as calibrated: no value between .* change floor, route or anchors"):
        solve((Unknown(OFFICE, MAIN, WIFI), table(), range(SEEDS.start, SEEDS.start + 3)))


def test_nothing_is_solved_for_twice_and_never_on_the_proposed_method():
    asked = unknowns()
    assert len(set(asked)) == len(asked)
    assert {unknown.estimator for unknown in asked} == {ODOMETRY, WIFI}
    assert not any(unknown.target_m == unknown.environment.maxima_m[PROPOSED] for unknown in asked)


def test_files_keep_their_comments_and_lead_back_to_the_same_scenarios(tmp_path, monkeypatch):
    numbers = {ODOMETRY: Solved(0.5, 0.24), WIFI: Solved(1.5, 0.82)}
    monkeypatch.setattr(
        environment_files, "solve_all", lambda *_: ((unknown, numbers[unknown.estimator]) for unknown in unknowns())
    )
    lines = []
    written = write_calibrated(tmp_path, report=lines.append)
    assert [path.name for path in written] == [*(f"{e.scenario}.toml" for e in ENVIRONMENTS), ALTERNATIVES_FILE]
    assert len(lines) == len(unknowns())
    text = (tmp_path / "paper_office.toml").read_text()
    assert "# four independently driven wheels" in text
    scenario = load_scenario(tmp_path / "paper_office.toml")
    assert scenario.reality.shadowing_std_db == 1.5
    assert scenario.reality.track_scale_bias == 0.02
    assert scenario.calibration["odometry_factor"] == 0.5
    other = calibrated_alternative(OFFICE, OBSTRUCTIONS, tmp_path)
    assert other.reality.obstruction_mean_db == 1.5
    again = write_calibrated(tmp_path / "again", scenarios=tmp_path)
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in written]


def test_folder_without_calibrated_files_is_refused_with_a_remedy(tmp_path):
    with pytest.raises(WorldError, match=r"paper_office\.toml: cannot be read"):
        load_scenario(OFFICE.place(tmp_path))
    with pytest.raises(FusionError, match=r"alternatives\.toml: .*--calibrate"):
        calibrated_alternative(OFFICE, OBSTRUCTIONS, tmp_path)
