"""A simulated run is written into a log, the same bytes for the same seed, or kept in memory."""

import math

import numpy as np
import pytest

from fusion import LogError, ParameterError, Truth
from logs.reader import read_run
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulate, simulated_run


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


def test_a_run_in_memory_is_the_run_in_its_log(tmp_path):
    logged, held = read_run(simulate("mec", tmp_path / "mec.mcap", seed=4)), simulated_run(load_scenario("mec"), 4)
    assert held.measurements == logged.measurements
    assert (held.name, held.world, held.prior) == (logged.name, logged.world, logged.prior)
    for column in ("time_ns", "x", "y"):
        assert np.array_equal(getattr(held.truth, column), getattr(logged.truth, column))
    # Logs hold headings as quaternions, which round.
    assert held.truth.heading == pytest.approx(logged.truth.heading, abs=1e-12)


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
