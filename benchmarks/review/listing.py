"""The worst moments as lines of text, each with the command that shows it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from benchmarks.review.error_causes import Growth
from benchmarks.review.moments import JUST_BEFORE_S, Moment
from benchmarks.runner.review_command import review_command
from fusion.cli.options import Settings


def as_lines(moments: Sequence[Moment], run: Sequence[str], settings: Settings, seed: int) -> list[str]:
    """The worst moments as lines, each with its review command; ``run``: the words that name the run."""
    lines = []
    for moment in moments:
        params = settings.get(moment.estimator)
        command = review_command(run, moment.estimator, moment.at_s, params=params, seed=seed)
        lines += [f"{line(moment)}\n", f"    {command}\n"]
    return lines


def line(moment: Moment) -> str:
    """One moment with its error, its causes and its counterfactuals."""
    grown = "" if moment.growth is None or not math.isfinite(moment.error_m) else f" ({_grown(moment.growth)})"
    facts = [*moment.causes, *(f"{name}: {_length(error_m)}" for name, error_m in moment.otherwise.items())]
    return f"{moment.estimator} at {moment.at_s:.2f} s: {_length(moment.error_m)}{grown}; {'; '.join(facts)}"


def _length(error_m: float) -> str:
    return f"{error_m:.2f} m" if math.isfinite(error_m) else "no answer"


def _grown(growth: Growth) -> str:
    start = f"{growth.before_m:.2f} m {JUST_BEFORE_S:g} s before"
    return f"{start}, {growth.scans_m:+.2f} m by scans, {growth.between_m:+.2f} m between them"
