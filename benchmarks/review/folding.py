"""The estimators of a review over its run, ghosts among them, and their scores, for whatever draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from benchmarks.cell import Cell, Score, score_run
from benchmarks.review.counterfactual import Counterfactual, counterfactual_run
from benchmarks.review.particle_clouds import CloudWatch
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from fusion.cli.options import Settings
from logs.run import Run


def fold(
    run: Run, chosen: Settings, seed: int, *, instead: Sequence[Counterfactual] = ()
) -> tuple[list[EstimatorRun], list[Score]]:
    """The estimators ``chosen``, each with its parameters, over the run and over what might have happened ``instead``:
    each with its score.
    """
    folds = [(run, _watched_run(run, name, params, seed)) for name, params in chosen.items()]
    folds += [
        (what_if.run, counterfactual_run(name, params, what_if, seed))
        for what_if in instead
        for name, params in chosen.items()
    ]
    scores = [
        score_run(Cell(run.path, estimator_run.name, {}, seed), folded, estimator_run)
        for folded, estimator_run in folds
    ]
    return [estimator_run for _, estimator_run in folds], scores


def _watched_run(run: Run, name: str, params: Mapping[str, object], seed: int) -> EstimatorRun:
    """Its run, with its particles where it shows them."""
    watch = CloudWatch(run)
    estimator_run = run_estimator(run, name, params, seed, watch=watch)
    return replace(estimator_run, clouds=watch.clouds())
