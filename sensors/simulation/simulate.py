"""`fusion simulate`: drive a simulated robot and record its sensors."""

from __future__ import annotations

import math
from pathlib import Path

from fusion import ParameterError, Truth
from fusion.values import nanoseconds
from logs.run import Run
from logs.truth import TruthTrack
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.scenario import Scenario, load_scenario


def simulate(scenario: str | Path, output: Path, *, seed: int = 0, duration_s: float | None = None) -> Path:
    """Record one run of a built-in scenario, or of a scenario file, as a log at ``output``.

    ``duration_s`` cuts the route short; it never makes it longer. Raises `WorldError` on a scenario that is unknown or
    wrong, `ParameterError` on a seed or duration that means nothing, `LogError` where ``output`` cannot be written.
    """
    from logs.writer import RunWriter

    if seed < 0:
        raise ParameterError(f"seed {seed}: must not be negative; give 0, 1, 2 ...")
    if duration_s is not None and not (math.isfinite(duration_s) and duration_s > 0.0):
        raise ParameterError(
            f"duration {duration_s} s: must be a time greater than zero; leave it out for the whole route"
        )
    loaded = load_scenario(scenario)
    robot = SimulatedRobot(loaded, seed)
    end_ns = None if duration_s is None else nanoseconds(duration_s)
    about, name = _about(loaded, seed), f"{loaded.name}-{seed}"
    with RunWriter(output, loaded.world, name=name, prior=robot.prior(), metadata=about) as log:
        for message in robot.run():
            if end_ns is not None and message.time_ns > end_ns:
                break
            log.write_truth(message) if isinstance(message, Truth) else log.write(message)
    return output


def simulated_run(scenario: Scenario, seed: int) -> Run:
    """One run in memory: as reading the log of `simulate` back, but for its path and the rounding of headings."""
    robot = SimulatedRobot(scenario, seed)
    messages = list(robot.run())
    return Run(
        path=Path(f"{scenario.name}-{seed}.mcap"),
        name=f"{scenario.name}-{seed}",
        world=scenario.world,
        prior=robot.prior(),
        metadata=_about(scenario, seed),
        measurements=tuple(message for message in messages if not isinstance(message, Truth)),
        truth=TruthTrack.from_truths([message for message in messages if isinstance(message, Truth)]),
        warnings=(),
        lanes={},
    )


def _about(scenario: Scenario, seed: int) -> dict[str, str]:
    return {"source": "simulated", "scenario": scenario.name, "seed": str(seed)}
