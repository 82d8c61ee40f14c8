"""The estimators of a review over its run, counterfactuals among them, with their scores, for whatever draws them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from benchmarks.review.counterfactual import Counterfactual
from benchmarks.review.particle_clouds import Clouds, CloudWatch
from benchmarks.runner.estimator_run import EstimatorRun, run_estimator
from benchmarks.runner.reference import Reference
from benchmarks.runner.scoring import End, Score, score
from fusion.cli.options import Settings
from logs.run import Run


@dataclass(frozen=True)
class Reviewed:
    """One estimator over the run, or over what might have happened instead: then it is the counterfactual of an
    estimator and bears a name of its own. ``clouds``: its particles, where it shows them.
    """

    made: EstimatorRun
    score: Score
    cost_s: float | None = None
    """Processor time per measurement [s]."""
    clouds: Clouds | None = None
    counterfactual_of: str | None = None

    @classmethod
    def of(cls, run: Run, made: EstimatorRun, clouds: Clouds | None = None) -> Reviewed:
        """An estimator's run with its score and its cost."""
        crash = None if made.error is None else End("crashed", made.error)
        scored = score(made.track, made.fates, Reference.of(run), crash=crash)
        cost_s = made.cpu_s / len(run.measurements) if run.measurements and crash is None else None
        return cls(made, scored, cost_s, clouds)

    @property
    def name(self) -> str:
        """The name of the estimator, or of its counterfactual."""
        return self.made.name


def fold(run: Run, chosen: Settings, seed: int, *, instead: Sequence[Counterfactual] = ()) -> list[Reviewed]:
    """The estimators ``chosen``, each with its parameters, over the run and the runs ``instead`` of it."""
    reviewed = [_watched(run, name, params, seed) for name, params in chosen.items()]
    return reviewed + [
        counterfactual(name, params, what_if, seed) for what_if in instead for name, params in chosen.items()
    ]


def _watched(run: Run, name: str, params: Mapping[str, object], seed: int) -> Reviewed:
    watch = CloudWatch(run)
    made = run_estimator(run, name, params, seed, watch=watch)
    return Reviewed.of(run, made, watch.clouds())


def counterfactual(name: str, params: Mapping[str, object], what_if: Counterfactual, seed: int) -> Reviewed:
    """An estimator over a run that did not take place."""
    made = run_estimator(what_if.run, name, params, seed)
    named = replace(made, name=f"{name} {what_if.suffix}")
    return replace(Reviewed.of(what_if.run, named), counterfactual_of=name)
