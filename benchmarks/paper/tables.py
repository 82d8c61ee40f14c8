"""The tables of the reproduction: the paper's numbers beside ours, in centimetres."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.paper.assumptions import ALTERNATIVES, MAIN
from benchmarks.paper.claims import Judged
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.interpretation_study import Effect, Ranked, literal_of_scale
from benchmarks.paper.interpretations import ORIGINS_M, SCALES, literal
from benchmarks.paper.outlier_rule_examples import Leg, Moved
from benchmarks.paper.published import BISWAS_VELOSO, EKF, ODOMETRY, PROPOSED, TABLE_1, WIFI
from benchmarks.paper.summary import Share, Spread, beats_both
from fusion.arrays import Floats
from fusion.output.tables import Table

CURVES = {ODOMETRY: "odometry", WIFI: "Wi-Fi", PROPOSED: "proposed"}
"""The paper's names."""


def cm(value_m: float) -> str:
    """Whole centimetres, with a digit after the point below ten; ∞ where there was no answer."""
    if math.isinf(value_m):
        return "∞"
    return f"{100.0 * value_m:.0f}" if value_m >= 0.0995 else f"{100.0 * value_m:.1f}"


def spread_cm(values_m: Floats) -> str:
    """Median and 90 % interval over seeds."""
    spread = Spread.of(values_m)
    return f"{cm(spread.median)} [{cm(spread.low)}, {cm(spread.high)}]"


def percent(share: Share) -> str:
    """A share with its 90 % interval.

    >>> percent(Share(3, 4, 0.374, 0.936))
    '75 [37, 94]'
    """
    return f"{100.0 * share.value:.0f} [{100.0 * share.low:.0f}, {100.0 * share.high:.0f}]"


def maxima(outcomes: Sequence[Outcome]) -> Table:
    """Section IV: the largest error over the trial points, published and found."""
    rows = [
        (
            f"{outcome.environment.title} (n = {outcome.environment.path_loss_exponent:g}, "
            f"{outcome.environment.trial_points} points), {title}",
            cm(outcome.environment.maxima_m[estimator]),
            spread_cm(outcome.largest(estimator)),
            spread_cm(outcome.euclidean(estimator).max(axis=1)),
        )
        for outcome in outcomes
        for estimator, title in CURVES.items()
    ]
    head = ("largest error, cm", "paper", "ours, per coordinate", "ours, Euclidean")
    return Table("Maximum error (section IV): median and 90 % interval over seeds", head, tuple(rows))


def verdicts(judged: Sequence[Judged], outcomes: Sequence[Outcome]) -> Table:
    """Every claim, and in how many of the runs it holds."""
    environments = [outcome.environment for outcome in outcomes]
    rows = []
    for claim, shares, verdict, _ in judged:
        held = (percent(shares[each.title]) if each.title in shares else "" for each in environments)
        rows.append((claim.text, *held, verdict))
    head = ("claim", *(f"{each.short}, %" for each in environments), "verdict")
    return Table("Claims: share of runs in which each holds [90 % interval], and the verdict", head, tuple(rows))


def reasons(judged: Sequence[Judged]) -> Table:
    """The measure of every claim, and the reasons of its verdict."""
    rows = tuple((each.claim.text, each.claim.measured_as, each.reason) for each in judged)
    return Table("Claims: how each is measured, and why", ("claim", "holds in a run when", "reason"), rows, prose=True)


def table_1(outcomes: Sequence[Outcome]) -> Table:
    """Table I, which is about the arena: no other environment has such a maximum."""
    arena = outcomes[-1]
    errors = np.abs(arena.errors[PROPOSED])
    measures = {
        "larger coordinate": arena.coordinate(PROPOSED),
        "x alone": errors[..., 0],
        "y alone": errors[..., 1],
        "Euclidean": arena.euclidean(PROPOSED),
    }
    published = [
        (f"{title}, published", cm(row.mean_m), cm(row.min_m), cm(row.max_m))
        for title, row in (("proposed", TABLE_1[PROPOSED]), (BISWAS_VELOSO, TABLE_1[BISWAS_VELOSO]))
    ]
    ours = [
        (f"proposed, ours, {title}", *(spread_cm(each(values, axis=1)) for each in (np.mean, np.min, np.max)))
        for title, values in measures.items()
    ]
    return Table("Table I: error in the arena, cm", ("", "mean", "min", "max"), (*published, *ours))


def estimators(outcomes: Sequence[Outcome]) -> Table:
    """Every estimator on the same runs, the best first."""
    rows = [
        (
            estimator,
            *(
                text
                for outcome in outcomes
                for text in (spread_cm(outcome.largest(estimator)), cm(_rmse(outcome, estimator)))
            ),
        )
        for estimator in by_median(outcomes)
    ]
    bound = ("Cramér-Rao bound of a fix", *(text for outcome in outcomes for text in ("–", cm(bound_rms_m(outcome)))))
    head = ("", *(text for o in outcomes for text in (f"{o.environment.short}\nlargest, cm", "RMSE, cm")))
    title = "Every estimator on the same runs: largest coordinate error, and Euclidean RMSE over points and seeds"
    return Table(title, head, (*rows, bound))


def by_median(outcomes: Sequence[Outcome]) -> list[str]:
    """The estimators, the best first: by the product over environments of their median largest errors."""
    medians = {
        estimator: [Spread.of(outcome.largest(estimator)).median for outcome in outcomes]
        for estimator in outcomes[0].errors
    }
    return sorted(medians, key=lambda estimator: (math.prod(medians[estimator]), estimator))


def _rmse(outcome: Outcome, estimator: str) -> float:
    return math.sqrt(float(np.mean(outcome.euclidean(estimator) ** 2)))


def bound_rms_m(outcome: Outcome) -> float:
    """Root mean square over the trial points of what no unbiased fix can beat [m]."""
    return math.sqrt(float(np.mean(np.trace(outcome.bound, axis1=1, axis2=2))))


RECORDED_STD_DB = 4.45
"""Of one reading, in the public recordings of a robot among Wi-Fi anchors that `fusion import cdoa` reads, pooled."""


def bounds(outcomes: Sequence[Outcome]) -> Table:
    """The physical limit of a radio fix."""
    rows = []
    for outcome in outcomes:
        stated_db = outcome.scenario.world.anchors[0].radio.std
        limit_m, fix_m = bound_rms_m(outcome), _rmse(outcome, WIFI)
        rows.append(
            (
                outcome.environment.title,
                f"{stated_db:.2f}",
                cm(limit_m),
                cm(fix_m),
                f"{limit_m / fix_m:.2f}",
                cm(limit_m * RECORDED_STD_DB / stated_db),
            )
        )
    head = ("", "σ, dB", "bound, cm", "Wi-Fi alone, cm", "efficiency", f"bound at {RECORDED_STD_DB:g} dB, cm")
    return Table("Cramér-Rao bound of the radio fix, root mean square over the trial points", head, tuple(rows))


def alternatives(outcomes: Sequence[Outcome]) -> Table:
    """The paper's three curves in every filling, and how often the proposed one is the best."""
    rows = []
    for filling in (MAIN, *ALTERNATIVES):
        for outcome in outcomes:
            curves = filling_curves(outcome, filling.key)
            rows.append(
                (
                    f"{filling.title}, {outcome.environment.short}",
                    spread_cm(curves[ODOMETRY]),
                    spread_cm(curves[WIFI]),
                    *(f"{cm(Spread.of(curves[name]).median)} ({beating(curves, name)})" for name in (*SCALES, EKF)),
                )
            )
    head = ("filling", "odometry", "Wi-Fi", *(f"% of\n{scale}" for scale in SCALES), EKF)
    title = (
        "Other fillings: largest error, cm. Of the proposed method, interpreted in four ways, and of the EKF: the "
        "median, and how often it beats odometry and Wi-Fi"
    )
    return Table(title, head, tuple(rows))


def beating(curves: Mapping[str, Floats], name: str) -> str:
    """In how many runs one of `filling_curves` beats both of the paper's."""
    return f"{100.0 * Share.of(beats_both(curves[name], curves[ODOMETRY], curves[WIFI])).value:.0f} %"


def filling_curves(outcome: Outcome, key: str) -> Mapping[str, Floats]:
    """Largest errors (n,) [m] in a filling: odometry, Wi-Fi, EKF, and the proposed method by outlier scale."""
    if key != MAIN.key:
        return outcome.alternatives[key]
    own = {estimator: outcome.largest(estimator) for estimator in (ODOMETRY, WIFI, EKF)}
    return own | {scale: outcome.interpretations[:, literal_of_scale(scale)] for scale in SCALES}


def interpretations(ranked: Sequence[Ranked], outcomes: Sequence[Outcome], shown: int = 8) -> Table:
    """The interpretations closest to the paper, the literal one wherever it stands, and the furthest."""
    places = sorted({*range(shown), [r.interpretation for r in ranked].index(literal()), len(ranked) - 1})
    rows = []
    for place in places:
        each = ranked[place]
        name = f"{place + 1}. {each.interpretation}" + (" (the defaults)" if each.interpretation == literal() else "")
        cells = (f"{cm(m)} ({100 * b.value:.0f} %)" for m, b in zip(each.medians_m, each.beats_both, strict=True))
        rows.append((name, f"{each.factor:.2f}", *cells))
    published = ("published", "1", *(cm(outcome.environment.proposed_max_m) for outcome in outcomes))
    head = (
        "interpretation: outlier in percent ...",
        "off by factor",
        *(f"{o.environment.short}, cm" for o in outcomes),
    )
    title = (
        f"{len(ranked)} interpretations of the algorithm: median largest error, and in brackets how often it beats both"
    )
    return Table(title, head, (published, *rows))


def effects(by_option: Sequence[Effect], outcomes: Sequence[Outcome]) -> Table:
    """Effect of each open option."""
    rows = []
    for option, medians, ratio in by_option:
        rows += [(f"{option} = {value}", *map(cm, row)) for value, row in medians.items()]
        rows.append((f"{option}: largest / smallest", *(f"{each:.2f}" for each in ratio)))
    head = ("median largest error, cm, geometric mean over all other options", *(o.environment.short for o in outcomes))
    return Table("Effect of each open option", head, tuple(rows))


def origins(outcomes: Sequence[Outcome]) -> Table:
    """The same runs with the map's origin elsewhere."""
    rows = [
        (
            "in the middle of the floor" if offset_m is None else f"{offset_m:g} m outside its corner",
            *(spread_cm(outcome.origins[:, k]) for outcome in outcomes),
        )
        for k, offset_m in enumerate(ORIGINS_M)
    ]
    head = ("origin", *(f"{outcome.environment.short}, cm" for outcome in outcomes))
    return Table("The same runs with the origin moved: largest error of the proposed method", head, tuple(rows))


def origin_example(rows: Sequence[Moved]) -> Table:
    """The minimal example of the origin."""
    cells = tuple(
        (
            f"{row.offset_m:g}",
            f"{row.odometry_x_m:g}",
            f"{row.odometry_x_m + 0.5:g}",
            f"{row.differs_percent:.1f}",
            "outlier" if row.is_outlier else "taken",
            f"{row.answer_x_m:.2f}",
        )
        for row in rows
    )
    head = ("origin moved by, m", "x odometry, m", "x Wi-Fi, m", "differs, %", "verdict", "answer in the room, m")
    return Table("The percentage rule depends on where the origin is", head, cells)


def lock_out_example(legs: Sequence[Leg]) -> Table:
    """The minimal example of the lock-out, at some of its corners."""
    shown = [leg for leg in legs if leg.trial <= 6 or leg.trial == len(legs)]
    cells = tuple((f"{leg.trial}", cm(leg.proposed_m), f"{leg.refused_in_a_row}", cm(leg.repaired_m)) for leg in shown)
    head = ("trial", "proposed, cm", "exact fixes refused in a row", "repaired, cm")
    return Table("Lock-out: one slip of 1 m on the third leg, exact odometry and exact fixes otherwise", head, cells)
