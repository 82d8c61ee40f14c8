"""The open readings as one study: which comes closest to the paper, and how much each option matters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretations import (
    MISSING_OPTION,
    MISSING_VALUES,
    OPTIONS,
    READINGS,
    SCALE_OPTION,
    Reading,
    literal,
)
from benchmarks.paper.published import ODOMETRY, WIFI
from benchmarks.paper.summary import Share, Spread, beats_both
from fusion.arrays import Floats


class Ranked(NamedTuple):
    """A reading: how far its median largest errors are from the published ones, as a mean factor; those medians [m],
    and how often it beats odometry and Wi-Fi, per environment.
    """

    reading: Reading
    factor: float
    medians_m: tuple[float, ...]
    beats_both: tuple[Share, ...]


class Effect(NamedTuple):
    """How much one option matters: median largest error [m] by value, geometric mean over all other options, and the
    largest of these over the smallest, per environment.
    """

    option: str
    medians_m: Mapping[str, tuple[float, ...]]
    ratio: tuple[float, ...]


def literal_of_scale(scale: str) -> int:
    """Place in `READINGS` of the estimator's defaults, but for what the percentage is of."""
    default = literal()
    values = tuple(scale if option == SCALE_OPTION else v for option, v in zip(OPTIONS, default.values, strict=True))
    return READINGS.index(Reading(values))


def rank(outcomes: Sequence[Outcome]) -> list[Ranked]:
    """All readings, the closest to the paper first: by the mean over environments of |ln(ours / published)|."""
    medians = np.array([[Spread.of(column).median for column in outcome.readings.T] for outcome in outcomes])
    published = np.array([[outcome.environment.proposed_max_m] for outcome in outcomes])
    factors = np.exp(np.abs(np.log(medians / published)).mean(axis=0))
    ranked = [
        Ranked(reading, float(factors[k]), tuple(medians[:, k].tolist()), tuple(_beats(o, k) for o in outcomes))
        for k, reading in enumerate(READINGS)
    ]
    return sorted(ranked, key=lambda each: (each.factor, str(each.reading)))


def _beats(outcome: Outcome, k: int) -> Share:
    return Share.of(beats_both(outcome.readings[:, k], outcome.largest(ODOMETRY), outcome.largest(WIFI)))


def effects(outcomes: Sequence[Outcome]) -> list[Effect]:
    """Of every option of the grid, and of what missing Wi-Fi counts, on the runs where it goes missing."""
    medians = [np.array([Spread.of(column).median for column in outcome.readings.T]) for outcome in outcomes]
    found = []
    for place, (option, values) in enumerate(OPTIONS.items()):
        chosen = {value: [reading.values[place] == value for reading in READINGS] for value in values}
        rows = {str(v): tuple(_geometric(m[mask]) for m in medians) for v, mask in chosen.items()}
        found.append(Effect(option, rows, _ratio(rows)))
    missing = {
        value: tuple(Spread.of(outcome.missing[:, k]).median for outcome in outcomes)
        for k, value in enumerate(MISSING_VALUES)
    }
    return [*found, Effect(MISSING_OPTION, missing, _ratio(missing))]


def _geometric(values: Floats) -> float:
    return float(np.exp(np.log(values).mean()))


def _ratio(rows: Mapping[str, tuple[float, ...]]) -> tuple[float, ...]:
    columns = np.array(list(rows.values()))
    return tuple((columns.max(axis=0) / columns.min(axis=0)).tolist())
