"""One run of one environment under every estimator, interpretation and origin, as small arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import fusion
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.matching import match
from benchmarks.paper.interpretations import (
    INTERPRETATIONS,
    MISSING_OPTION,
    MISSING_VALUES,
    ORIGINS_M,
    SCALE_OPTION,
    SCALES,
)
from benchmarks.paper.published import EKF, ODOMETRY, PROPOSED, WIFI
from benchmarks.paper.straight_moves import measured_moves
from benchmarks.paper.variants import leg_by_leg, missing_wifi, moved_by, with_gyro, without_gyro
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from fusion import Decision, WifiScan
from fusion.arrays import Floats
from logs.run import Run
from logs.truth import evaluation_instants
from sensors.simulation.scenario import Scenario, load_scenario
from sensors.simulation.simulate import simulated_run

GYRO = " + gyro"
GYRO_ESTIMATORS = (ODOMETRY, PROPOSED, "bayes_weight", EKF)
"""Estimators that are also run on the turns of a gyro: the paper's future work, and the best filter beside it."""


class Trial(NamedTuple):
    """All results of one run [m]: errors (points, 2) by estimator, infinite without a valid answer; whether the
    proposed method took a fix for an outlier, (points,); its largest error by interpretation, by the count of missing
    Wi-Fi, by origin; straight moves as its odometry measures them; the error of each estimator that crashed.
    """

    errors: Mapping[str, Floats]
    refused: NDArray[np.bool_]
    interpretations: Floats
    missing: Floats
    origins: Floats
    moves: Floats
    crashes: Mapping[str, str]


def largest(errors: Floats) -> float:
    """The largest absolute coordinate error [m] of (points, 2)."""
    return float(np.abs(errors).max())


def point_errors(run: Run, track: Track) -> Floats:
    """Estimate minus truth where the truth was surveyed, (points, 2) [m], infinite without a valid answer."""
    assert run.truth is not None
    instants = evaluation_instants(run.truth)
    answers = match(instants, track)
    away = np.stack([answers.x - instants.x, answers.y - instants.y], axis=1)
    return np.where(answers.valid[:, None], away, np.inf)


@lru_cache(maxsize=8)
def _scenario(place: str | Path) -> Scenario:
    return load_scenario(place)


def run_trial(task: tuple[str | Path, int], estimators: Sequence[str] | None = None) -> Trial:
    """Of a scenario, built in or a file, and a seed: a pure function of both and of the estimators.

    ``estimators`` None: those of this package, for what else is installed must not change the paper's tables. The
    paper's curves and the filter to beat are always among them.
    """
    place, seed = task
    ours = set(fusion.built_in_names()) & set(fusion.available())
    chosen = {*(ours if estimators is None else estimators), ODOMETRY, WIFI, PROPOSED, EKF}
    scenario = _scenario(place)
    whole = simulated_run(scenario, seed)
    plain, aided = without_gyro(whole), with_gyro(whole, scenario.reality)
    made = {name: (plain, run_estimator(plain, name, seed=seed)) for name in sorted(chosen)}
    made |= {name + GYRO: (aided, run_estimator(aided, name, seed=seed)) for name in GYRO_ESTIMATORS}
    brief = leg_by_leg(plain)
    return Trial(
        {name: point_errors(run, one.track) for name, (run, one) in made.items()},
        _refused(made[PROPOSED][1]),
        np.array([proposed_largest(brief, each.options) for each in INTERPRETATIONS]),
        np.array([proposed_largest(missing_wifi(brief, seed), {MISSING_OPTION: value}) for value in MISSING_VALUES]),
        np.array([proposed_largest(moved_by(brief, offset_m)) for offset_m in ORIGINS_M]),
        measured_moves(scenario, seed),
        {name: one.error for name, (_, one) in made.items() if one.error is not None},
    )


def run_alternative(task: tuple[Scenario, int]) -> Mapping[str, float]:
    """The largest error [m] in another filling: odometry, Wi-Fi, EKF, and the proposed method by outlier scale."""
    scenario, seed = task
    brief = leg_by_leg(without_gyro(simulated_run(scenario, seed)))
    alone = {
        name: largest(point_errors(brief, run_estimator(brief, name, seed=seed).track))
        for name in (ODOMETRY, WIFI, EKF)
    }
    return alone | {scale: proposed_largest(brief, {SCALE_OPTION: scale}) for scale in SCALES}


def proposed_largest(run: Run, options: Mapping[str, object] | None = None) -> float:
    """The largest error [m] of the proposed method, interpreted by ``options``."""
    assert run.prior is not None
    estimator = fusion.load(PROPOSED)(run.world, **(options or {}))
    updates = list(fusion.track(estimator, run.world, run.measurements, run.prior))
    return largest(point_errors(run, Track.of(updates)))


def _refused(one: EstimatorRun) -> NDArray[np.bool_]:
    scans = [update for update in one.final if isinstance(update.measurement, WifiScan)]
    return np.array([any(fate.decision is Decision.REJECTED for fate in scan.fates) for scan in scans])
