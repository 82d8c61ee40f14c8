"""``fusion bench gate``: may this change land? Exit code 0 yes, 1 no, 2 wrong usage or suite, 3 not measured, 4
inconclusive, 5 not deterministic; of several the first of 2, 3, 5, 1, 4.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.cli.suite_arguments import opened, suite_options
from benchmarks.metrics.catalogue import more_is_better
from benchmarks.runner.gate import GRAVEST_FIRST, Finding, Outcome, judge, read_baseline
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import read_results, require_metric
from benchmarks.runner.verify import differing
from benchmarks.runner.workers import Limits
from fusion import FusionError, SuiteError
from fusion.cli.arguments import at_least_one


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench gate``."""
    suite_options(parser)
    parser.add_argument(
        "--baseline", type=Path, metavar="F", help="in place of the suite's: JSON of export, or HTML of report"
    )
    parser.add_argument("--verify", type=at_least_one, default=0, metavar="N", help="compute N cells again and compare")


def run(arguments: argparse.Namespace) -> int:
    """Judge, print every finding, answer the gravest."""
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
    for metric in filter(more_is_better, suite.gate.ratio):
        raise SuiteError(f"gate.ratio.{metric}: more of it is better, so it may grow as it likes; give it a floor")
    findings = judge(results, suite.gate, read_baseline(named) if named else None)
    if suite.gate.ratio and named is None:
        why = f"gate.ratio ({', '.join(suite.gate.ratio)}) compares with a baseline; give --baseline"
        findings.append(Finding(Outcome.NOT_MEASURED, why))
    findings += [
        Finding(Outcome.NOT_DETERMINISTIC, f"{cell}: computed again, it differs")
        for cell in differing(cells, store, arguments.verify, Limits(suite.limits.wall_s, suite.limits.rss_mb))
    ]
    findings += [Finding(Outcome.INCONCLUSIVE, sentence) for sentence in suite.left_out]
    if suite.gate.inconclusive == "warn":
        findings = [_as_warning(finding) for finding in findings]
    return findings or [Finding(Outcome.NOT_MEASURED, "the suite's [gate] asks for nothing; give ratio or floor")]


def _as_warning(finding: Finding) -> Finding:
    return finding._replace(outcome=Outcome.PASS) if finding.outcome is Outcome.INCONCLUSIVE else finding
