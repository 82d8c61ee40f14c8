"""``fusion bench gate``: may this change land? Exit code 0 yes, 1 no, 2 wrong usage or suite, 3 not measured, 4 cannot
tell, 5 not deterministic; of several the first of 2, 3, 5, 1, 4.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from enum import IntEnum, unique
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.arguments import at_least_one
from benchmarks.cell import ALIVE
from benchmarks.metrics.track import Floats
from benchmarks.runner.baseline import Baseline, Row, counterparts, read_baseline, scores
from benchmarks.runner.definition import CLEAN, Gate
from benchmarks.runner.plan import cells_of
from benchmarks.runner.plan_verb import opened, suite_options
from benchmarks.runner.results import (
    MORE_IS_BETTER,
    Result,
    by_contestant,
    read_results,
    require_metric,
    score_matrix,
)
from benchmarks.runner.verify_verb import differing
from benchmarks.statistics.verdict import compare
from benchmarks.workers import Limits
from fusion import FusionError, SuiteError


@unique
class Outcome(IntEnum):
    """What a gate says, as its exit code."""

    PASS = 0
    REGRESSION = 1
    USAGE = 2
    NOT_MEASURED = 3
    CANNOT_TELL = 4
    NOT_DETERMINISTIC = 5


GRAVEST_FIRST = (
    Outcome.USAGE,
    Outcome.NOT_MEASURED,
    Outcome.NOT_DETERMINISTIC,
    Outcome.REGRESSION,
    Outcome.CANNOT_TELL,
    Outcome.PASS,
)


class Finding(NamedTuple):
    """One condition of a gate, and what came of it."""

    outcome: Outcome
    text: str


def judge(results: Sequence[Result], gate: Gate, baseline: Baseline | None) -> list[Finding]:
    """Every condition of ``gate`` on results without faults."""
    findings = []
    for name, own in by_contestant(results, CLEAN).items():
        for metric, least in gate.floor.items():
            findings.append(_floor(name, own, metric, least))
        findings += [_inside(name, own, metric) for metric in gate.inside]
        if baseline is not None:
            findings += _against(name, own, gate, baseline.get(name))
    return findings


def _floor(name: str, own: Sequence[Result], metric: str, least: float) -> Finding:
    """A lost cell is below every floor; of one that has nothing to say nobody knows."""
    values = [result.metrics.get(metric, math.nan) for result in own]
    known = [
        -math.inf if math.isnan(value) and _is_lost(result) else value
        for value, result in zip(values, own, strict=True)
    ]
    silent = sum(map(math.isnan, known))
    worst = min((value for value in known if not math.isnan(value)), default=math.nan)
    text = f"{name}: {metric} is {worst:g} at worst, {least:g} at least is asked"
    if worst < least:
        return Finding(Outcome.REGRESSION, text)
    if silent:
        return Finding(Outcome.CANNOT_TELL, f"{name}: {metric} has nothing to say in {silent} of {len(own)} cells")
    return Finding(Outcome.PASS, text)


def _is_lost(result: Result) -> bool:
    return result.status not in ALIVE


def _inside(name: str, own: Sequence[Result], metric: str) -> Finding:
    """Whether every cell lies in its own chi-square band, which counts how correlated its errors are in time."""
    keys = (metric, f"{metric}_band_low", f"{metric}_band_high")
    value, low, high = np.array([[result.metrics.get(key, math.nan) for key in keys] for result in own]).T
    if not np.isfinite([value, low, high]).all():
        return Finding(Outcome.CANNOT_TELL, f"{name}: {metric} has no band in every cell; it claims no covariance, say")
    outside = np.flatnonzero((value < low) | (value > high))
    text = f"{name}: {metric} lies outside its band in {len(outside)} of {len(own)} cells"
    return Finding(Outcome.REGRESSION if len(outside) else Outcome.PASS, text)


def _against(name: str, own: Sequence[Result], gate: Gate, before: Sequence[Row] | None) -> list[Finding]:
    if before is None:
        return [Finding(Outcome.CANNOT_TELL, f"{name}: the baseline does not know it")]
    rows = counterparts(own, before)
    if rows is None:
        return [Finding(Outcome.CANNOT_TELL, f"{name}: the baseline has other runs or seeds")]
    findings = [
        Finding(Outcome.REGRESSION, f"{result.cell}: {result.status}, and was not before")
        for result, row in zip(own, rows, strict=True)
        if _is_lost(result) and row["status"] in ALIVE
    ]
    for metric, margin in gate.ratio.items():
        now = score_matrix(own, metric)
        findings.append(_ratio(name, metric, margin, now, scores(rows, metric).reshape(now.shape)))
    return findings


def _ratio(name: str, metric: str, margin: float, now: Floats, before: Floats) -> Finding:
    """Regression when the whole interval of now over before is above 1 + margin, or a run is lost that was not; pass
    when all of it is below.
    """
    if np.allclose(now, before, rtol=1e-12, atol=0.0):
        return Finding(Outcome.PASS, f"{name}: {metric} is what it was")
    if not (np.minimum(now, before) > 0.0).all():
        return Finding(Outcome.USAGE, f"{name}: {metric} is not above 0 everywhere, and has no ratio; ask for another")
    (verdict,) = compare({"now": now, "before": before}, metric).verdicts
    ratio, low, high = verdict.ratio
    text = f"{name}: {metric} now / before {ratio:.3f} [{low:.3f}, {high:.3f}], margin {1.0 + margin:g}"
    if verdict.losses:
        lost = f"is infinite or missing in {verdict.losses} of {verdict.runs} runs where it was not"
        return Finding(Outcome.REGRESSION, f"{name}: {metric} {lost}")
    if low > 1.0 + margin:
        return Finding(Outcome.REGRESSION, text)
    return Finding(Outcome.PASS if high <= 1.0 + margin else Outcome.CANNOT_TELL, text)


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench gate``."""
    suite_options(parser)
    parser.add_argument(
        "--baseline",
        type=Path,
        metavar="F",
        help="in place of the suite's: JSON of export, or HTML of report",
    )
    parser.add_argument("--verify", type=at_least_one, default=0, metavar="N", help="compute N cells again and compare")


def run(arguments: argparse.Namespace) -> int:
    """Judge, tell every finding, answer the gravest."""
    try:
        findings = _findings(arguments)
    except FusionError as error:
        findings = [Finding(Outcome.USAGE, str(error))]
    for finding in findings:
        sys.stdout.write(f"{finding.outcome.name.lower().replace('_', ' ')}: {finding.text}\n")
    return int(min((finding.outcome for finding in findings), key=GRAVEST_FIRST.index))


def _findings(arguments: argparse.Namespace) -> list[Finding]:
    suite, store = opened(arguments)
    cells = cells_of(suite, store)
    results = read_results(cells, store)
    if len(results) < len(cells) or not results:
        return [Finding(Outcome.NOT_MEASURED, f"{len(results)} of {len(cells)} cells are there; run the suite first")]
    named = arguments.baseline or (suite.folder / suite.gate.baseline if suite.gate.baseline else None)
    for metric in {*suite.gate.ratio, *suite.gate.floor, *suite.gate.inside}:
        require_metric(metric, results)
    for metric in filter(MORE_IS_BETTER.fullmatch, suite.gate.ratio):
        raise SuiteError(f"gate.ratio.{metric}: more of it is better, so it may grow as it likes; give it a floor")
    found = judge(results, suite.gate, read_baseline(named) if named else None)
    if suite.gate.ratio and named is None:
        asked = ", ".join(suite.gate.ratio)
        found.append(Finding(Outcome.NOT_MEASURED, f"gate.ratio ({asked}) compares with a baseline; give --baseline"))
    found += [
        Finding(Outcome.NOT_DETERMINISTIC, f"{cell}: computed again, it differs")
        for cell in differing(cells, store, arguments.verify, Limits(suite.limits.wall_s, suite.limits.rss_mb))
    ]
    found += [Finding(Outcome.CANNOT_TELL, sentence) for sentence in suite.left_out]
    if suite.gate.inconclusive == "warn":
        found = [one._replace(outcome=Outcome.PASS) if one.outcome is Outcome.CANNOT_TELL else one for one in found]
    return found or [Finding(Outcome.NOT_MEASURED, "the suite's [gate] asks for nothing; give ratio or floor")]
