"""The claims of the paper, each as a test that a run passes or fails, and the verdict over all runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from benchmarks.paper import evidence
from benchmarks.paper.evidence import GROWN, LARGE_OUTLIER, LINEAR_R2, Held
from benchmarks.paper.experiment import Outcome
from benchmarks.paper.published import ENVIRONMENTS
from benchmarks.paper.summary import Share, runs_to_exclude

NEARLY_ALWAYS, NEARLY_NEVER = 0.90, 0.10
"""A claim counts as reproduced when in every environment the whole interval of its share is above the first, and as not
when it is below the second."""
FEWEST_RUNS = math.ceil(runs_to_exclude(0.0, NEARLY_NEVER))
"""25. With fewer, even a claim that never held has an interval that reaches beyond `NEARLY_NEVER`."""
REPRODUCED, NOT_REPRODUCED = "reproduced", "not reproduced"
EVERYWHERE = tuple(environment.scenario for environment in ENVIRONMENTS)
ARENA = EVERYWHERE[-1:]
"""Table I is about the arena: no other environment has such a maximum."""


class Claim(NamedTuple):
    """``holds`` answers for each run of an environment, (n,); ``reason`` explains that, in words and numbers."""

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

    @property
    def is_decided(self) -> bool:
        """True where more runs change nothing about its verdict, if the claim goes on holding as often."""
        return runs_to_decide([*self.shares.values()]) <= min(share.total for share in self.shares.values())


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
        return f"inconclusive from {fewest} runs"
    if min(share.low for share in shares) >= NEARLY_ALWAYS:
        return REPRODUCED
    if max(share.high for share in shares) <= NEARLY_NEVER:
        return NOT_REPRODUCED
    return f"{REPRODUCED} in {100.0 * sum(s.held for s in shares) / sum(s.total for s in shares):.0f} %"


def runs_to_decide(shares: Sequence[Share]) -> float:
    """Number of runs of each environment that decides a claim which goes on holding as often: until all shares are
    nearly always, or all nearly never, or it is certain that neither is so. Infinite where a share is just at a limit.
    """
    values = [share.value for share in shares]
    by_always = [(value >= NEARLY_ALWAYS, runs_to_exclude(value, NEARLY_ALWAYS)) for value in values]
    by_never = [(value <= NEARLY_NEVER, runs_to_exclude(value, NEARLY_NEVER)) for value in values]
    for by_limit in (by_always, by_never):
        if all(kept for kept, _ in by_limit):
            return max(FEWEST_RUNS, *(runs for _, runs in by_limit))
    return max(FEWEST_RUNS, *(min(runs for kept, runs in by_limit if not kept) for by_limit in (by_always, by_never)))


def in_words(judged: Sequence[Judged]) -> str:
    """The claims counted: nearly always, nearly never, in a part of the runs, undecided; and what would decide."""
    decided = [each.verdict for each in judged if each.is_decided]
    whole, missing = decided.count(REPRODUCED), decided.count(NOT_REPRODUCED)
    counts = (
        f"Of {len(judged)} claims {whole} hold in nearly every run, {missing} in nearly none, "
        f"{len(decided) - whole - missing} in a part of the runs or not in every environment"
    )
    needed = [runs_to_decide([*each.shares.values()]) for each in judged if not each.is_decided]
    return f"{counts}; undecided: {len(needed)}{_would_decide(needed)}."


def _would_decide(needed: Sequence[float]) -> str:
    """About how many runs would decide claims that need so many each."""
    known = sorted(_two_digits(runs) for runs in needed if math.isfinite(runs))
    if not known:
        return ", at a limit to the run" if needed else ""
    least, most = (f"{runs:,}".replace(",", " ") for runs in (known[0], known[-1]))
    if len(known) < len(needed):
        return f", which {least} runs or more would decide"
    return f", which {f'about {least}' if least == most else f'{least} to {most}'} runs would decide"


def _two_digits(runs: float) -> int:
    """Rounded up: an estimate from shares that are estimates."""
    unit: int = 10 ** max(math.ceil(math.log10(runs)) - 2, 0)
    return math.ceil(runs / unit) * unit


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
