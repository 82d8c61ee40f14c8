"""The evidence for each claim: whether a run keeps it, and the numbers behind that."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.metrics.score import quantile
from benchmarks.paper import summary
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.published import BISWAS_VELOSO, ODOMETRY, PROPOSED, TABLE_1, WIFI, ErrorRow
from fusion.arrays import Floats

LARGE_OUTLIER = 3.0
"""Times the median error of a run."""
GROWN = 2.0
"""Times the error of the first third of the trial points."""
LINEAR_R2 = 0.99

Held = NDArray[np.bool_]


def beats_both(outcome: Outcome) -> Held:
    """The proposed method's largest error is below that of odometry and that of Wi-Fi."""
    odometry, wifi, proposed = outcome.published_curves
    return summary.beats_both(proposed, odometry, wifi)


def halves_larger(outcome: Outcome) -> Held:
    """It is at most half the larger of theirs."""
    return _over_larger(outcome) <= 0.5


def halves_both(outcome: Outcome) -> Held:
    """It is at most half of each of theirs."""
    return _over_smaller(outcome) <= 0.5


def _over_smaller(outcome: Outcome) -> Floats:
    odometry, wifi, proposed = outcome.published_curves
    return np.asarray(proposed / np.minimum(odometry, wifi))


def _over_larger(outcome: Outcome) -> Floats:
    odometry, wifi, proposed = outcome.published_curves
    return np.asarray(proposed / np.maximum(odometry, wifi))


def within_maximum(outcome: Outcome) -> Held:
    """The proposed method's largest error is at most the published one."""
    return np.asarray(outcome.largest(PROPOSED) <= outcome.environment.proposed_max_m)


def within_table_1(outcome: Outcome) -> Held:
    """Mean and maximum are at most those of the paper's row."""
    return _within(outcome, TABLE_1[PROPOSED])


def as_good_as_fingerprints(outcome: Outcome) -> Held:
    """Mean and maximum are at most those of the other row."""
    return _within(outcome, TABLE_1[BISWAS_VELOSO])


def _within(outcome: Outcome, row: ErrorRow) -> Held:
    mean = outcome.coordinate(PROPOSED).mean(axis=1)
    return np.asarray((mean <= row.mean_m) & (outcome.largest(PROPOSED) <= row.max_m))


def has_wifi_outliers(outcome: Outcome) -> Held:
    """The largest Wi-Fi error is so many times the median one."""
    return np.asarray(_outlier_ratio(outcome) >= LARGE_OUTLIER)


def _outlier_ratio(outcome: Outcome) -> Floats:
    errors = outcome.coordinate(WIFI)
    return np.asarray(errors.max(axis=1) / np.median(errors, axis=1))


def odometry_grows(outcome: Outcome) -> Held:
    """The last third of the trial points errs so many times as much as the first."""
    return np.asarray(_growth(outcome) >= GROWN)


def _growth(outcome: Outcome) -> Floats:
    errors = outcome.coordinate(ODOMETRY)
    third = errors.shape[1] // 3
    return np.asarray(errors[:, -third:].mean(axis=1) / errors[:, :third].mean(axis=1))


def is_linear(outcome: Outcome) -> Held:
    """Actual over measured moves is a straight line."""
    return np.asarray(outcome.moves_r2 >= LINEAR_R2)


def refused_share(outcome: Outcome) -> float:
    """Share of fixes that the proposed method takes for outliers."""
    return float(outcome.refused.mean())


def refused_though_better(outcome: Outcome) -> float:
    """Share of those that were nearer to the truth than its own answer then."""
    better = outcome.euclidean(WIFI) < outcome.euclidean(PROPOSED)
    return float(better[outcome.refused].mean()) if outcome.refused.any() else 0.0


def taken_though_worse(outcome: Outcome) -> float:
    """Share of the fixes it takes that were further from the truth than odometry alone."""
    worse, taken = outcome.euclidean(WIFI) > outcome.euclidean(ODOMETRY), ~outcome.refused
    return float(worse[taken].mean()) if taken.any() else 0.0


def _each(outcomes: Sequence[Outcome], text: Callable[[Outcome], str]) -> str:
    return ", ".join(f"{outcome.environment.short} {text(outcome)}" for outcome in outcomes)


def _median_of(ratio: Callable[[Outcome], Floats]) -> Callable[[Outcome], str]:
    return lambda outcome: f"{quantile(ratio(outcome), 0.5):.1f}"


def _percent(share: Callable[[Outcome], float]) -> Callable[[Outcome], str]:
    return lambda outcome: f"{100.0 * share(outcome):.0f} %"


def _proposed_cm(outcome: Outcome) -> str:
    return f"{100.0 * quantile(outcome.largest(PROPOSED), 0.5):.0f} cm"


def why_better_or_not(outcomes: Sequence[Outcome]) -> str:
    """Shares of fixes that the gate takes and refuses."""
    return (
        f"Median ratio to the better of the two: {_each(outcomes, _median_of(_over_smaller))}. Of all fixes "
        f"{_each(outcomes, _percent(refused_share))} are refused; of those refused, "
        f"{_each(outcomes, _percent(refused_though_better))} were better than the method's own answer; of those taken, "
        f"{_each(outcomes, _percent(taken_though_worse))} were worse than odometry alone."
    )


def over_larger(outcomes: Sequence[Outcome]) -> str:
    """The median ratio."""
    return f"Median ratio to the larger of the two: {_each(outcomes, _median_of(_over_larger))}."


def over_smaller(outcomes: Sequence[Outcome]) -> str:
    """The median ratio."""
    return f"Median ratio to the smaller of the two: {_each(outcomes, _median_of(_over_smaller))}."


def median_maxima(outcomes: Sequence[Outcome]) -> str:
    """The method's largest error."""
    return f"Median run: {_each(outcomes, _proposed_cm)}."


def mean_and_maximum(outcomes: Sequence[Outcome]) -> str:
    """The method's."""

    def mean_cm(outcome: Outcome) -> str:
        return f"{100.0 * quantile(outcome.coordinate(PROPOSED).mean(axis=1), 0.5):.0f} cm"

    return f"Median run: mean {_each(outcomes, mean_cm)}, maximum {_each(outcomes, _proposed_cm)}."


def outlier_ratios(outcomes: Sequence[Outcome]) -> str:
    """Ratio of the largest Wi-Fi error to the median one."""
    return (
        f"Largest over median error, median run: {_each(outcomes, _median_of(_outlier_ratio))}. The shadowing of eq. 3 "
        "is Gaussian and the same everywhere: its errors have no second kind, only a largest among more or fewer."
    )


def growth(outcomes: Sequence[Outcome]) -> str:
    """Growth of odometry's error."""
    return f"Last third over first third, median run: {_each(outcomes, _median_of(_growth))}."


def linearity(outcomes: Sequence[Outcome]) -> str:
    """Straightness of the line."""
    return (
        f"Smallest r² of a run: {_each(outcomes, lambda outcome: f'{outcome.moves_r2.min():.4f}')}. It holds by "
        "construction: our wheels err by a scale, by slip and by whole ticks."
    )
