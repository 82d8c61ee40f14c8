"""Calibration of what the paper does not give, so that odometry alone and Wi-Fi alone err as much as the paper's did.

Per environment and filling two numbers are solved for, each against one published maximum, and never against the
proposed method's. The target is the median over `SEEDS` of the largest absolute coordinate error over the trial
points. These seeds are never those of an experiment, which count from 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np

from benchmarks.paper.assumptions import ALTERNATIVES, MAIN, Filling, Table, filled, short
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, WIFI, Environment
from benchmarks.paper.trial import largest, point_errors
from benchmarks.runner.estimator_run import run_estimator
from benchmarks.runner.workers import TaskFailure, compute
from fusion import FusionError
from sensors.simulation.scenario import Scenario
from sensors.simulation.simulate import simulated_run

SEEDS = range(1_000_000, 1_000_400)
BRACKETS = {ODOMETRY: (0.02, 8.0), WIFI: (0.01, 40.0)}
"""Brackets of the solution: a factor, and dB."""
TOLERANCE = 0.01
"""Of the solution, as a share of it."""


class Unknown(NamedTuple):
    """One number to be solved for: how strongly an estimator errs in an environment, filled in one way."""

    environment: Environment
    filling: Filling
    estimator: str

    @property
    def target_m(self) -> float:
        """The published maximum [m]."""
        return self.environment.maxima_m[self.estimator]


class Solved(NamedTuple):
    """The number, and the median largest error [m] it leads to."""

    value: float
    reached_m: float


def unknowns() -> list[Unknown]:
    """All there are: a filling that changes nothing for an estimator has the main one's number."""
    fillings = [(filling, filling is MAIN) for filling in (MAIN, *ALTERNATIVES)]
    return [
        Unknown(environment, filling, estimator)
        for environment in ENVIRONMENTS
        for filling, is_main in fillings
        for estimator, like_main in ((ODOMETRY, filling.drives_like_main), (WIFI, filling.receives_like_main))
        if is_main or not like_main
    ]


def largest_error(unknown: Unknown, table: Table, value: float, seed: int) -> float:
    """The largest absolute coordinate error [m] of one run at one ``value``, sensors the estimator does not use off."""
    numbers = (value, 1.0) if unknown.estimator == ODOMETRY else (1.0, value)
    quiet = filled(table, unknown.filling, *numbers)
    quiet["reality"]["gyro_hz"] = 0.0
    quiet["reality"] |= {"ticks_hz": 0.0} if unknown.estimator == WIFI else {"scans_at_stop": 1}
    run = simulated_run(Scenario.from_table(unknown.environment.scenario, quiet), seed)
    return largest(point_errors(run, run_estimator(run, unknown.estimator, seed=seed).track))


def solve(task: tuple[Unknown, Table, range]) -> Solved:
    """The value at which the median meets the target, to four digits, on a logarithmic scale (Brent 1973, chapter 4).

    Each source of chance is drawn alike whatever the value, so the median moves smoothly with it. Deterministic.
    """
    from scipy.optimize import brentq

    unknown, table, seeds = task

    @cache
    def median_m(value: float) -> float:
        return float(np.median([largest_error(unknown, table, value, seed) for seed in seeds]))

    def excess(log_value: float) -> float:
        return math.log(median_m(short(math.exp(log_value))) / unknown.target_m)

    low, high = map(math.log, BRACKETS[unknown.estimator])
    if not excess(low) < 0.0 < excess(high):
        raise FusionError(
            f"{unknown.environment.title}, {unknown.filling.title}: no value between "
            f"{BRACKETS[unknown.estimator]} makes {unknown.estimator} err {unknown.target_m} m; change "
            f"floor, route or anchors of {unknown.environment.scenario}"
        )
    value = short(math.exp(brentq(excess, low, high, xtol=TOLERANCE)))
    return Solved(value, short(median_m(value)))


def _died(task: tuple[Unknown, Table, range], _: TaskFailure) -> Solved:
    unknown = task[0]
    raise FusionError(
        f"a worker process died on {unknown.environment.title}, {unknown.filling.title}; calibrate with --workers 1 "
        "to see why"
    )


def solve_all(tables: Mapping[str, Table], seeds: range = SEEDS, workers: int = 1) -> Iterator[tuple[Unknown, Solved]]:
    """Every unknown as it is solved; ``tables`` holds the scenarios by name."""
    asked = unknowns()
    tasks = [(unknown, tables[unknown.environment.scenario], seeds) for unknown in asked]
    for index, solved in compute(solve, _died, tasks, workers):
        yield asked[index], solved
