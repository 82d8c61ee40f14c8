"""The whole reproduction as one thing that can be printed, written as JSON, or made into a page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

import fusion
from benchmarks.paper import tables
from benchmarks.paper.assumption_table import assumptions
from benchmarks.paper.claims import Judged, judge
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretation_study import Ranked, effects, rank
from benchmarks.paper.interpretations import ORIGINS_M
from benchmarks.paper.outlier_rule_examples import lock_out_example, origin_example
from benchmarks.paper.summary import Spread
from fusion.arrays import Floats
from fusion.output.tables import Table


class Report(NamedTuple):
    """Outcomes per environment, the verdict on each claim, all interpretations by closeness, and the tables by name."""

    outcomes: tuple[Outcome, ...]
    judged: tuple[Judged, ...]
    ranked: tuple[Ranked, ...]
    tables: Mapping[str, Table]

    @classmethod
    def of(cls, outcomes: Sequence[Outcome]) -> Report:
        """Everything that follows from the outcomes."""
        judged, ranked, matter = judge(outcomes), rank(outcomes), effects(outcomes)
        by_name = {
            "maxima": tables.maxima(outcomes),
            "verdicts": tables.verdicts(judged, outcomes),
            "reasons": tables.reasons(judged),
            "table_1": tables.table_1(outcomes),
            "estimators": tables.estimators(outcomes),
            "bounds": tables.bounds(outcomes),
            "interpretations": tables.interpretations(ranked, outcomes),
            "effects": tables.effects(matter, outcomes),
            "origin_example": tables.origin_example(origin_example()),
            "origins": tables.origins(outcomes),
            "lock_out_example": tables.lock_out_example(lock_out_example()),
            "alternatives": tables.alternatives(outcomes),
            "assumptions": assumptions(outcomes),
        }
        return cls(tuple(outcomes), tuple(judged), tuple(ranked), by_name)

    @property
    def remarks(self) -> list[str]:
        """Remarks beside the tables: the errors of estimators that crashed."""
        return [
            f"{outcome.environment.title}: {estimator} crashed: {why}"
            for outcome in self.outcomes
            for estimator, why in outcome.crashes.items()
        ]

    def record(self) -> dict[str, object]:
        """For strict JSON, in metres; the same bytes for the same trials, seed and software. Infinite is None."""
        seeds = self.outcomes[0].seeds
        return {
            "paper": "Moro & Mehrpouyan 2019, arXiv 1911.03754",
            "trials": len(seeds),
            "first_seed": seeds[0],
            "fusion": fusion.__version__,
            "numpy": np.__version__,
            "environments": [_environment(outcome) for outcome in self.outcomes],
            "claims": [_claim(each) for each in self.judged],
            "readings": [_interpretation(each) for each in self.ranked],
        }


def _environment(outcome: Outcome) -> dict[str, object]:
    return {
        "title": outcome.environment.title,
        "scenario": outcome.environment.scenario,
        "world_hash": outcome.scenario.world.hash,
        "calibration": dict(outcome.scenario.calibration),
        "published_max_m": outcome.environment.maxima_m,
        "bound_rms_m": _number(tables.bound_rms_m(outcome)),
        "largest_m": {estimator: _numbers(outcome.largest(estimator)) for estimator in outcome.errors},
        "largest_euclidean_m": {
            estimator: _numbers(outcome.euclidean(estimator).max(axis=1)) for estimator in outcome.errors
        },
        "refused": [int(count) for count in outcome.refused.sum(axis=1)],
        "origins_m": {str(offset_m): _spread(outcome.origins[:, k]) for k, offset_m in enumerate(ORIGINS_M)},
        "alternatives_m": {
            key: {curve: _spread(values) for curve, values in curves.items()}
            for key, curves in outcome.alternatives.items()
        },
        "crashes": dict(outcome.crashes),
    }


def _claim(judged: Judged) -> dict[str, object]:
    claim, shares, verdict, reason = judged
    return {
        "key": claim.key,
        "claim": claim.text,
        "measured_as": claim.measured_as,
        "verdict": verdict,
        "reason": reason,
        "held": {title: {"runs": share.held, "of": share.total} for title, share in shares.items()},
    }


def _interpretation(ranked: Ranked) -> dict[str, object]:
    return {
        "options": ranked.interpretation.options,
        "off_by_factor": _number(ranked.factor),
        "median_largest_m": _numbers(ranked.medians_m),
        "beats_both": [_number(share.value) for share in ranked.beats_both],
    }


def _spread(values: Floats) -> dict[str, float | None]:
    return {name: _number(value) for name, value in Spread.of(values)._asdict().items()}


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [_number(float(value)) for value in values]


def _number(value: float) -> float | None:
    """A tenth of a millimetre is more than enough, and keeps the file small."""
    return round(value, 4) if math.isfinite(value) else None
