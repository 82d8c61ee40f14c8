"""Verdicts on every pair of estimators, with their uncertainty, in one sentence each.

A pair is decided by the t interval of its log ratios, corrected over all pairs (Holm 1979): with ten estimators there
are 45 pairs, and of 45 equal pairs two would differ at 5 % by chance. Where one of the two was lost in a run (an
infinite score) their mean ratio does not exist; then the signed ranks over all runs decide, in which a lost run is the
worst there can be, and the ratio of the other runs stands beside.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.statistics.letters import letters
from benchmarks.statistics.paired_tests import (
    LEVEL,
    MAX_RUNS,
    MeanInterval,
    SignedRank,
    detectable_effect,
    friedman_p,
    holm,
    log_ratios,
    mean_interval,
    runs_needed,
    signed_rank,
)
from fusion import ParameterError
from fusion.arrays import Floats


@dataclass(frozen=True, slots=True)
class Verdict:
    """Verdict of the runs on one pair.

    ``log_ratio``: of first over second, below 0 where the first is better, from the ``compared`` runs in which both
    scored. In the others at least one was lost: ``wins`` (only the second was), ``losses`` (only the first), ``ties``
    (both were). ``signed_rank`` is of all runs. ``holm_p`` is the p that decides, corrected over all pairs
    that were compared together.
    """

    first: str
    second: str
    metric: str
    level: float
    compared: int
    wins: int
    losses: int
    ties: int
    log_ratio: MeanInterval[float]
    signed_rank: SignedRank
    holm_p: float

    @property
    def runs(self) -> int:
        """All runs, those where one was lost too."""
        return self.compared + self.wins + self.losses + self.ties

    @property
    def by_rank(self) -> bool:
        """True where the signed ranks decide, because one of the two was lost where the other was not."""
        return bool(self.wins or self.losses)

    @property
    def p(self) -> float:
        """The p that decides, before correction."""
        return self.signed_rank.p if self.by_rank else self.log_ratio.p

    @property
    def winner(self) -> str | None:
        """The better of the two; None: the runs are inconclusive."""
        if self.holm_p >= 1.0 - self.level:
            return None
        leaning = self.signed_rank.sum if self.by_rank else self.log_ratio.mean
        return self.first if leaning < 0.0 else self.second

    @property
    def ratio(self) -> tuple[float, float, float]:
        """Geometric mean of first over second, below 1 where the first is better, and the ends of its interval; NaN
        within (0, inf) where no run can be compared.
        """
        with np.errstate(over="ignore"):
            mean, low, high = np.exp([self.log_ratio.mean, self.log_ratio.low, self.log_ratio.high])
        return float(mean), float(low), float(high)

    @property
    def detectable(self) -> float:
        """The difference this many runs would show four times in five, as a share of the higher score."""
        if self.compared < 2:
            return 1.0
        return -math.expm1(-detectable_effect(self.compared, self.level) * self.log_ratio.std)

    @property
    def runs_needed(self) -> int | None:
        """Number of runs that would show the observed difference four times in five; None: more than can be driven."""
        mean, std = abs(self.log_ratio.mean), self.log_ratio.std
        if std == 0.0:  # runs that all have exactly the same ratio settle any difference at once
            return 2 if mean else None
        return runs_needed(mean / std, self.level)

    @property
    def sentence(self) -> str:
        """The verdict for people, with its uncertainty."""
        if self.winner is None:
            pair = f"inconclusive between {self.first} and {self.second} on {self.metric}"
            return f"{pair}: {self._ranks() if self.by_rank else self._uncertainty()}"
        pair = f"{self.winner} beats {self.second if self.winner == self.first else self.first}"
        if self.by_rank:
            return f"{pair} on {self.metric}: {self._ranks()}"
        return f"{pair} {by_percent(*self.ratio)} on {self.metric} ({self.compared} runs)"

    def _uncertainty(self) -> str:
        if self.compared < 2:
            runs = "run" if self.runs == 1 else "runs"
            return f"{self.compared} of {self.runs} {runs} can be compared, record at least 6, better 12"
        ratio = _ratio_text(*self.ratio)
        if self.p < 1.0 - self.level:
            return f"{ratio}, which alone would count, but among so many pairs may be chance (p {self.holm_p:.2g})"
        needed = f"more than {MAX_RUNS}" if self.runs_needed is None else f"at least {self.runs_needed}"
        least = f"{self.compared} runs show differences from {100.0 * self.detectable:.0f} %"
        return f"{ratio}, needs {needed} runs ({least})"

    def _ranks(self) -> str:
        lost = self.runs - self.compared
        where = f"lost runs decide, {self.first} wins {self.wins} and loses {self.losses} of {lost}"
        other = f", {_ratio_text(*self.ratio)} in the other {self.compared}" if self.compared else ""
        return f"{where}{other} (signed ranks of {self.runs} runs, p {self.holm_p:.2g})"


def _ratio_text(ratio: float, low: float, high: float) -> str:
    return f"ratio {ratio:.2f} [{low:.2f}, {high:.2f}]"


def by_percent(ratio: float, low: float, high: float) -> str:
    """Percentage by which the lower of two scores is lower, from their ratio or its inverse; its interval excludes 1.

    >>> by_percent(0.88, 0.81, 0.96)
    'by 12 % [4, 19]'
    """
    if low > 1.0:
        ratio, low, high = 1.0 / ratio, 1.0 / high, 1.0 / low
    gain, least, most = (100.0 * (1.0 - share) for share in (ratio, high, low))
    decimals = 0 if least >= 1.0 else 2
    return f"by {gain:.{decimals}f} % [{least:.{decimals}f}, {most:.{decimals}f}]"


@dataclass(frozen=True, slots=True)
class Comparison:
    """All pairs of estimators on one metric. ``letters``: estimators that share one cannot be distinguished.
    ``friedman_p``: that all of them are alike; None for two.
    """

    metric: str
    verdicts: tuple[Verdict, ...]
    letters: Mapping[str, str]
    friedman_p: float | None


def compare(scores: Mapping[str, Floats], metric: str, *, level: float = LEVEL) -> Comparison:
    """Judge estimators by their scores (runs, seeds), lower is better, +inf is lost; all on the same runs in the same
    order, the best first if the letters are to begin with it. The median over the seeds is the score of a run.

    Raises `ParameterError` for scores that do not belong together, are not positive or not a number.
    """
    if not 0.0 < level < 1.0:
        raise ParameterError(f"level {level}: must lie between 0 and 1; 0.95 is usual")
    medians = {name: _medians(name, own) for name, own in scores.items()}
    counts = {name: len(own) for name, own in medians.items()}
    if len(set(counts.values())) > 1:
        raise ParameterError(f"{metric}: estimators were scored on different numbers of runs, {counts}; bench them all")
    pairs = [_judge(medians, *pair, metric, level) for pair in itertools.combinations(medians, 2)]
    verdicts = _correct(pairs)
    apart = [(verdict.first, verdict.second) for verdict in verdicts if verdict.winner is not None]
    together = friedman_p(np.stack(list(medians.values()), axis=1)) if len(medians) > 2 else None
    return Comparison(metric, verdicts, letters(list(scores), apart), together)


def _medians(name: str, scores: Floats) -> Floats:
    if scores.ndim != 2 or scores.shape[1] == 0:
        raise ParameterError(f"{name}: scores have the shape {scores.shape}; give one row per run, one column per seed")
    if not (scores > 0.0).all():
        wrong = scores[~(scores > 0.0)][0]
        raise ParameterError(f"{name}: a score is {wrong}; give errors greater than zero, infinite where it was lost")
    return np.asarray(np.median(scores, axis=1))


def _judge(medians: Mapping[str, Floats], first: str, second: str, metric: str, level: float) -> Verdict:
    """One pair by itself: its p is not corrected yet."""
    differences = log_ratios(medians[first], medians[second])
    both = np.isfinite(medians[first]) & np.isfinite(medians[second])
    ranks = signed_rank(differences)
    mean = MeanInterval[float](*map(float, mean_interval(differences[both], level)))
    return Verdict(
        first,
        second,
        metric,
        level,
        compared=int(both.sum()),
        wins=int((differences == -np.inf).sum()),
        losses=int((differences == np.inf).sum()),
        ties=int((~both & (differences == 0.0)).sum()),
        log_ratio=mean,
        signed_rank=ranks,
        holm_p=1.0,
    )


def _correct(pairs: Sequence[Verdict]) -> tuple[Verdict, ...]:
    corrected = holm(np.array([pair.p for pair in pairs])).tolist()
    return tuple(replace(pair, holm_p=p) for pair, p in zip(pairs, corrected, strict=True))
