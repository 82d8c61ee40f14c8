"""The estimators of a review over its run, ghosts among them: their lanes and scores, for whatever draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from benchmarks.cell import Cell, Score, score_lane
from benchmarks.review.counterfactual import Counterfactual, ghost_lane
from benchmarks.review.particle_clouds import CloudWatch
from benchmarks.runner.estimator_run import Lane, run_lane
from fusion.cli.options import Settings
from logs.run import Run


def fold(
    run: Run, chosen: Settings, seed: int, *, instead: Sequence[Counterfactual] = ()
) -> tuple[list[Lane], list[Score]]:
    """The estimators ``chosen``, each with its parameters, over the run and over what might have happened ``instead``:
    each lane with its score.
    """
    folds = [(run, _watched_lane(run, name, params, seed)) for name, params in chosen.items()]
    folds += [
        (what_if.run, ghost_lane(name, params, what_if, seed)) for what_if in instead for name, params in chosen.items()
    ]
    scores = [score_lane(Cell(run.path, lane.name, {}, seed), folded, lane) for folded, lane in folds]
    return [lane for _, lane in folds], scores


def _watched_lane(run: Run, name: str, params: Mapping[str, object], seed: int) -> Lane:
    """A lane with the particles of an estimator that shows them."""
    watch = CloudWatch(run)
    lane = run_lane(run, name, params, seed, watch=watch)
    return replace(lane, clouds=watch.clouds())
