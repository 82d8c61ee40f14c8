"""A gyro of known bias and scale is found again; the Allan deviation against published numbers; poor input."""

import dataclasses
import math

import numpy as np
import pytest

from fusion import Gyro, LogError, ParameterError, WheelTicks
from sensors.calibration.allan import allan, allan_deviation
from sensors.calibration.gyro import calibrate_gyro

NOISE = 0.01
PERIOD_S = 0.02


def test_allan_deviation_agrees_with_the_reference_data():
    """The 1000-point test suite of NBS (Riley 2008, section 12.4): overlapping deviations at 1, 10 and 100."""
    numbers = [1_234_567_890]
    for _ in range(999):
        numbers.append(16_807 * numbers[-1] % 2_147_483_647)
    found = allan_deviation(np.array(numbers) / 2_147_483_647, np.array([1, 10, 100]))
    assert found == pytest.approx([2.922319e-01, 9.159953e-02, 3.241343e-02], rel=1e-6)


def test_white_noise_has_its_density_within_the_interval():
    random = np.random.default_rng(0)
    density = NOISE * math.sqrt(PERIOD_S)
    held = [allan(random.normal(0.0, NOISE, 300), PERIOD_S).noise.holds(density) for _ in range(300)]
    assert 0.91 < np.mean(held) < 0.99


def test_a_bias_that_wanders_is_the_lowest_point_of_the_curve():
    random = np.random.default_rng(1)
    wander = np.cumsum(random.normal(0.0, 2e-5, 20_000))
    found = allan(random.normal(0.0, NOISE, 20_000) + wander, PERIOD_S)
    assert found.is_lowest
    assert found.tau_s[0] < found.tau_s[np.argmin(found.deviation)] < found.tau_s[-1]


def test_bias_and_scale_are_held_by_their_intervals_as_often_as_they_say(drive, scaled_gyro):
    held = []
    for seed in range(12):
        run = scaled_gyro(drive(seed, gyro_hz=50.0, gyro_bias_std_rad_s=0.0, pause_s=2.0), 1.03, 0.02)
        found = calibrate_gyro([run])
        held += [found.bias.holds(0.02), found.scale.holds(1.03)]
        assert found.scale.reach < 0.005
    assert np.mean(held) >= 0.84


def test_held_out_parts_are_better_afterwards(drive, scaled_gyro):
    run = scaled_gyro(drive(gyro_hz=50.0, gyro_bias_std_rad_s=0.0, pause_s=2.0, gyro_noise_std_rad_s=0.002), 1.03, 0.02)
    scores = {score.what: score for score in calibrate_gyro([run]).scores}
    assert scores["rate at rest"].after < 0.1 * scores["rate at rest"].before
    assert scores["turn of a piece"].after < 0.2 * scores["turn of a piece"].before


def test_turns_counted_by_a_mark_give_the_scale_without_truth(drive, scaled_gyro):
    """Ten laps around a square, all left turns but for the first: from standstill to standstill 10 turns."""
    route = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    run = scaled_gyro(drive(waypoints=[*route, [0.0, 0.0]], laps=1, gyro_hz=50.0, pause_s=2.0), 1.05, 0.01)
    blind = dataclasses.replace(run, truth=None)
    # Three quarter turns lie between the first stop, after the first side, and the last.
    found = calibrate_gyro([blind], turns=0.75)
    assert found.scale.holds(1.05)
    assert found.scale.reach < 0.05


def test_a_robot_that_is_carried_about_does_not_stand_still(drive):
    run = drive(gyro_hz=50.0, gyro_bias_std_rad_s=0.0, pause_s=2.0)
    stops = calibrate_gyro([run]).standstills
    begin, end = stops[2].from_ns, stops[2].until_ns
    carried = tuple(
        dataclasses.replace(m, rate_rad_s=m.rate_rad_s + 0.5)
        if isinstance(m, Gyro) and begin <= m.time_ns <= end
        else m
        for m in run.measurements
    )
    found = calibrate_gyro([dataclasses.replace(run, measurements=carried)])
    assert len(found.standstills) == len(stops) - 1
    assert abs(found.bias.value) < 0.005


def test_samples_that_are_no_numbers_are_left_out(drive):
    run = drive(gyro_hz=50.0, pause_s=2.0)
    bad = tuple(
        dataclasses.replace(m, rate_rad_s=math.nan) if isinstance(m, Gyro) and i % 50 == 0 else m
        for i, m in enumerate(run.measurements)
    )
    found = calibrate_gyro([dataclasses.replace(run, measurements=bad)])
    assert math.isfinite(found.bias.value)
    assert math.isfinite(found.scale.value)


def test_poor_runs_are_refused_with_the_remedy(drive):
    run = drive(gyro_hz=50.0)
    with pytest.raises(LogError, match="holds no gyro"):
        calibrate_gyro([drive()])
    deaf = tuple(m for m in run.measurements if not isinstance(m, WheelTicks))
    with pytest.raises(LogError, match="no wheel ticks"):
        calibrate_gyro([dataclasses.replace(run, measurements=deaf)])
    with pytest.raises(LogError, match="no standstill"):
        calibrate_gyro([drive(gyro_hz=50.0, pause_s=0.0)])
    with pytest.raises(ParameterError, match="not zero"):
        calibrate_gyro([run], turns=0.0)
