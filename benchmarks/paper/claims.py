"""What the paper claims, each claim as a test that a run passes or fails, and the verdict over all runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from benchmarks.paper import evidence
from benchmarks.paper.evidence import GROWN, LARGE_OUTLIER, LINEAR_R2, Held
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.published import ENVIRONMENTS
from benchmarks.paper.summary import Share

NEARLY_ALWAYS, NEARLY_NEVER = 0.90, 0.10
"""A claim counts as reproduced when in every environment the whole interval of its share is above the first, and as not
when it is below the second."""
FEWEST_RUNS = 25
"""With fewer, even a claim that never held has an interval that reaches beyond `NEARLY_NEVER`."""
REPRODUCED, NOT_REPRODUCED = "reproduced", "not reproduced"
EVERYWHERE = tuple(environment.scenario for environment in ENVIRONMENTS)
ARENA = EVERYWHERE[-1:]
"""Table I is about the arena: no other environment has such a maximum."""


class Claim(NamedTuple):
    """``holds`` answers for each run of an environment, (n,); ``reason`` says why, in words and numbers."""

    key: str
    text: str
    measured_as: str
    holds: Callable[[Outcome], Held]
    reason: Callable[[Sequence[Outcome]], str]
    scenarios: tuple[str, ...] = EVERYWHERE


class Judged(NamedTuple):
    """A claim and how often it held, by title of the environment."""

    claim: Claim
    shares: Mapping[str, Share]
    verdict: str
    reason: str


def judge(outcomes: Sequence[Outcome]) -> list[Judged]:
    """Every claim of `CLAIMS`, on the environments it is about."""
    judged = []
    for claim in CLAIMS:
        own = [outcome for outcome in outcomes if outcome.environment.scenario in claim.scenarios]
        shares = {outcome.environment.title: Share.of(claim.holds(outcome)) for outcome in own}
        judged.append(Judged(claim, shares, verdict(list(shares.values())), claim.reason(own)))
    return judged


def verdict(shares: Sequence[Share]) -> str:
    """In every environment nearly always, nearly never, or how often.

    >>> verdict([Share(30, 40, 0.63, 0.84)])
    'reproduced in 75 %'
    """
    fewest = min(share.total for share in shares)
    if fewest < FEWEST_RUNS:
        return f"cannot tell from {fewest} runs"
    if min(share.low for share in shares) >= NEARLY_ALWAYS:
        return REPRODUCED
    if max(share.high for share in shares) <= NEARLY_NEVER:
        return NOT_REPRODUCED
    return f"{REPRODUCED} in {100.0 * sum(s.held for s in shares) / sum(s.total for s in shares):.0f} %"


CLAIMS = (
    Claim(
        "linear_odometry",
        "Odometry follows a linear model of actual over set distance (Fig. 3)",
        f"r² of a straight line over moves of 0.25 m to 3 m is at least {LINEAR_R2}",
        evidence.is_linear,
        evidence.linearity,
    ),
    Claim(
        "wifi_outliers",
        "Wi-Fi has large outliers and is accurate between them (section III-A)",
        f"its largest error is at least {LARGE_OUTLIER:g} times its median one",
        evidence.has_wifi_outliers,
        evidence.outlier_ratios,
    ),
    Claim(
        "odometry_grows",
        "Odometry is accurate for the first trials and then grows (section IV)",
        f"its mean error over the last third of the trial points is at least {GROWN:g} times that over the first",
        evidence.odometry_grows,
        evidence.growth,
    ),
    Claim(
        "beats_both",
        "The proposed method outperforms both Wi-Fi and odometry on their own (section IV)",
        "its largest error is below both of theirs, by a millimetre at least",
        evidence.beats_both,
        evidence.why_better_or_not,
    ),
    Claim(
        "halves_larger",
        "It can more than halve the error of either (section V), of the worse of the two",
        "its largest error is at most half the larger of theirs",
        evidence.halves_larger,
        evidence.over_larger,
    ),
    Claim(
        "halves_both",
        "It can more than halve the error of either (section V), of both",
        "its largest error is at most half of each of theirs",
        evidence.halves_both,
        evidence.over_smaller,
    ),
    Claim(
        "maxima",
        "Its maximum error is 5, 53 and 80 cm (section IV)",
        "its largest error is at most that",
        evidence.within_maximum,
        evidence.median_maxima,
    ),
    Claim(
        "table_1",
        "Its mean error is 30 cm and its maximum 81 cm (Table I)",
        "both at most that, in the arena, the only environment with such a maximum",
        evidence.within_table_1,
        evidence.mean_and_maximum,
        ARENA,
    ),
    Claim(
        "fingerprints",
        "It performs as well as Wi-Fi fingerprints, 70 cm mean and 160 cm maximum (Table I)",
        "both at most that, in the arena",
        evidence.as_good_as_fingerprints,
        evidence.mean_and_maximum,
        ARENA,
    ),
)
"""In the order of the paper's argument."""
