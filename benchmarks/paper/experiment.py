"""Every environment over many seeds: the trials of all runs, stacked seed by seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.limits.fix_bound import rssi_fix_bound
from benchmarks.paper.assumptions import ALTERNATIVES
from benchmarks.paper.environment_files import calibrated_alternative
from benchmarks.paper.fit_environments import SEEDS
from benchmarks.paper.published import ENVIRONMENTS, ODOMETRY, PROPOSED, WIFI, Environment
from benchmarks.paper.straight_moves import r_squared
from benchmarks.paper.trial import Trial, run_alternative, run_trial
from benchmarks.runner.workers import TaskFailure, compute
from fusion import FusionError, ParameterError
from fusion.arrays import Floats
from fusion.output.progress import Progress
from sensors.simulation.scenario import Scenario, load_scenario


class Outcome(NamedTuple):
    """Outcome of one environment, n seeds of p trial points [m].

    ``errors``: (n, p, 2) by estimator, infinite without a valid answer. ``refused``: (n, p), whether the proposed
    method took the fix for an outlier. ``interpretations``, ``missing``, ``origins``: (n, ...), its largest error by
    each. ``moves``: (n, moves), straight ones as odometry measures them. ``alternatives``: largest errors (n,) by
    filling and curve. ``bound``: (p, 2, 2) [m^2], least covariance of a radio fix at each trial point. ``crashes``: by
    estimator, the error of the first run that crashed.
    """

    environment: Environment
    scenario: Scenario
    seeds: tuple[int, ...]
    errors: Mapping[str, Floats]
    refused: NDArray[np.bool_]
    interpretations: Floats
    missing: Floats
    origins: Floats
    moves: Floats
    alternatives: Mapping[str, Mapping[str, Floats]]
    bound: Floats
    crashes: Mapping[str, str]

    def largest(self, estimator: str) -> Floats:
        """The largest absolute coordinate error of each run, (n,) [m]: the paper's measure."""
        return np.asarray(np.abs(self.errors[estimator]).max(axis=(1, 2)))

    def coordinate(self, estimator: str) -> Floats:
        """The larger of both coordinate errors at each trial point, (n, p) [m]."""
        return np.asarray(np.abs(self.errors[estimator]).max(axis=2))

    def euclidean(self, estimator: str) -> Floats:
        """The distance from the truth at each trial point, (n, p) [m]."""
        return np.hypot(self.errors[estimator][..., 0], self.errors[estimator][..., 1])

    @property
    def moves_r2(self) -> Floats:
        """Coefficient of determination of actual over measured moves, (n,)."""
        return np.array([r_squared(measured) for measured in self.moves])

    @property
    def published_curves(self) -> tuple[Floats, Floats, Floats]:
        """Largest errors (n,) [m] of odometry, Wi-Fi and the proposed method."""
        return self.largest(ODOMETRY), self.largest(WIFI), self.largest(PROPOSED)


class Job(NamedTuple):
    """One run: its work, its scenario and its seed."""

    work: Callable[[tuple[Any, int]], Any]
    scenario: str | Path | Scenario
    seed: int


def run_experiments(
    trials: int,
    *,
    seed: int = 0,
    scenarios: Path | None = None,
    estimators: Sequence[str] | None = None,
    workers: int = 1,
    progress: Progress = lambda *_: None,
) -> tuple[Outcome, ...]:
    """All environments over the seeds from ``seed`` on; the same numbers whatever the workers. ``estimators``: as
    `run_trial` takes them.

    Raises `ParameterError` for seeds that calibration has used: nothing is judged on what it was fitted to.
    """
    seeds = range(seed, seed + trials)
    if trials < 1 or seed < 0:
        raise ParameterError(f"{trials} trials from seed {seed}: give 1 or more, from a seed not below 0")
    if seeds.start < SEEDS.stop and SEEDS.start < seeds.stop:
        raise ParameterError(
            f"seeds {seeds.start} to {seeds.stop - 1}: those from {SEEDS.start} to {SEEDS.stop - 1} are what the "
            "scenarios were calibrated on; choose another --seed"
        )
    jobs = [job for environment in ENVIRONMENTS for job in _jobs(environment, seeds, scenarios, estimators)]
    results: dict[int, Any] = {}
    for index, result in compute(_run, _died, jobs, workers):
        results[index] = result
        progress(len(results), len(jobs), "runs")
    share = len(jobs) // len(ENVIRONMENTS)
    return tuple(
        _outcome(environment, seeds, scenarios, [results[index] for index in range(k * share, (k + 1) * share)])
        for k, environment in enumerate(ENVIRONMENTS)
    )


def _jobs(
    environment: Environment, seeds: range, scenarios: Path | None, estimators: Sequence[str] | None
) -> list[Job]:
    """All runs of the main filling, then those of every other."""
    place = environment.place(scenarios)
    others = [calibrated_alternative(environment, filling, scenarios) for filling in ALTERNATIVES]
    main = [Job(partial(run_trial, estimators=estimators), place, seed) for seed in seeds]
    return main + [Job(run_alternative, scenario, seed) for scenario in others for seed in seeds]


def _run(job: Job) -> Any:  # noqa: ANN401 - a Trial, or a row of an alternative
    return job.work((job.scenario, job.seed))


def _died(job: Job, _: TaskFailure) -> Any:  # noqa: ANN401 - it never answers
    raise FusionError(f"a worker process died on seed {job.seed}, twice; try --workers 1 to see why")


def _outcome(environment: Environment, seeds: range, scenarios: Path | None, results: Sequence[Any]) -> Outcome:
    scenario = load_scenario(environment.place(scenarios))
    trials: Sequence[Trial] = results[: len(seeds)]
    others: Sequence[Mapping[str, float]] = results[len(seeds) :]
    by_filling = {each.key: others[i * len(seeds) : (i + 1) * len(seeds)] for i, each in enumerate(ALTERNATIVES)}
    return Outcome(
        environment,
        scenario,
        tuple(seeds),
        {estimator: np.stack([trial.errors[estimator] for trial in trials]) for estimator in trials[0].errors},
        np.stack([trial.refused for trial in trials]),
        np.stack([trial.interpretations for trial in trials]),
        np.stack([trial.missing for trial in trials]),
        np.stack([trial.origins for trial in trials]),
        np.stack([trial.moves for trial in trials]),
        {key: {curve: np.array([row[curve] for row in rows]) for curve in rows[0]} for key, rows in by_filling.items()},
        np.stack([rssi_fix_bound(scenario.world, *place) for place in scenario.route.waypoints_m[1:]]),
        dict(reversed([item for trial in trials for item in trial.crashes.items()])),
    )
