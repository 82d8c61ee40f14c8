"""The open interpretations as one study: their distances from the paper, and the effect of each option."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretations import (
    INTERPRETATIONS,
    MISSING_OPTION,
    MISSING_VALUES,
    OPTIONS,
    SCALE_OPTION,
    Interpretation,
    literal,
)
from benchmarks.paper.published import ODOMETRY, WIFI
from benchmarks.paper.summary import Share, Spread, beats_both
from fusion.arrays import Floats


class Ranked(NamedTuple):
    """An interpretation: the mean factor by which its median largest errors are off from the published ones; those
    medians [m], and how often it beats odometry and Wi-Fi, per environment.
    """

    interpretation: Interpretation
    factor: float
    medians_m: tuple[float, ...]
    beats_both: tuple[Share, ...]


class Effect(NamedTuple):
    """Effect of one option: median largest error [m] by value, geometric mean over all other options, and the
    largest of these over the smallest, per environment.
    """

    option: str
    medians_m: Mapping[str, tuple[float, ...]]
    ratio: tuple[float, ...]


def literal_of_scale(scale: str) -> int:
    """Place in `INTERPRETATIONS` of the estimator's defaults, but for what the percentage is of."""
    default = literal()
    values = tuple(scale if option == SCALE_OPTION else v for option, v in zip(OPTIONS, default.values, strict=True))
    return INTERPRETATIONS.index(Interpretation(values))


def rank(outcomes: Sequence[Outcome]) -> list[Ranked]:
    """All interpretations, the closest to the paper first: by the mean over environments of |ln(ours / published)|."""
    medians = np.array([[Spread.of(column).median for column in outcome.interpretations.T] for outcome in outcomes])
    published = np.array([[outcome.environment.proposed_max_m] for outcome in outcomes])
    factors = np.exp(np.abs(np.log(medians / published)).mean(axis=0))
    ranked = [
        Ranked(interpretation, float(factors[k]), tuple(medians[:, k].tolist()), tuple(_beats(o, k) for o in outcomes))
        for k, interpretation in enumerate(INTERPRETATIONS)
    ]
    return sorted(ranked, key=lambda each: (each.factor, str(each.interpretation)))


def _beats(outcome: Outcome, k: int) -> Share:
    return Share.of(beats_both(outcome.interpretations[:, k], outcome.largest(ODOMETRY), outcome.largest(WIFI)))


def effects(outcomes: Sequence[Outcome]) -> list[Effect]:
    """Of every option of the grid, and of what missing Wi-Fi counts, on the runs where it goes missing."""
    medians = [np.array([Spread.of(column).median for column in outcome.interpretations.T]) for outcome in outcomes]
    by_option = []
    for place, (option, values) in enumerate(OPTIONS.items()):
        chosen = {value: [each.values[place] == value for each in INTERPRETATIONS] for value in values}
        rows = {str(v): tuple(_geometric(m[mask]) for m in medians) for v, mask in chosen.items()}
        by_option.append(Effect(option, rows, _ratio(rows)))
    missing = {
        value: tuple(Spread.of(outcome.missing[:, k]).median for outcome in outcomes)
        for k, value in enumerate(MISSING_VALUES)
    }
    return [*by_option, Effect(MISSING_OPTION, missing, _ratio(missing))]


def _geometric(values: Floats) -> float:
    return float(np.exp(np.log(values).mean()))


def _ratio(rows: Mapping[str, tuple[float, ...]]) -> tuple[float, ...]:
    columns = np.array(list(rows.values()))
    return tuple((columns.max(axis=0) / columns.min(axis=0)).tolist())
