"""``fusion bench compare``: which estimator is better on these runs, or that they cannot tell."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn

from benchmarks.runner.definition import CLEAN, Suite
from benchmarks.runner.plan import cells_of
from benchmarks.runner.plan_verb import opened, suite_options
from benchmarks.runner.results import (
    RANKED_BY,
    Result,
    comparison,
    read_results,
    require_lower_is_better,
    require_metric,
)
from benchmarks.sheet import Sheet, print_sheets
from benchmarks.statistics.verdict import Comparison, Verdict
from fusion import ParameterError, SuiteError
from fusion.errors import did_you_mean

NOT_MEASURED = 3
"""Exit code of a verb that found nothing to judge."""


def stored_results(arguments: argparse.Namespace) -> tuple[Suite, list[Result]]:
    """The suite and its results; raises `SuiteError` while some are missing."""
    suite, store = opened(arguments)
    cells = cells_of(suite, store)
    results = read_results(cells, store)
    if len(results) < len(cells):
        refuse_incomplete(suite, len(results), len(cells))
    return suite, results


def refuse_incomplete(suite: Suite, there: int, wanted: int) -> NoReturn:
    """A part of a suite is not its result."""
    raise SuiteError(f"{suite.name}: {there} of {wanted} cells are there; run `fusion bench run` first")


def sheet(judged: Comparison) -> Sheet:
    """Every pair as one row."""
    rows = []
    for verdict in judged.verdicts:
        runs = f"{verdict.compared} of {verdict.runs}"
        numbers = (
            _ratio(verdict),
            runs,
            f"{verdict.holm_p:.2g}",
            f"{verdict.signed_rank.p:.2g}",
        )
        rows.append((f"{verdict.first} / {verdict.second}", *numbers, verdict.winner or "cannot tell"))
    head = ("pair", "ratio [95 %]", "runs compared", "p, Holm", "p, signed ranks", "better")
    return Sheet(f"Pairs on {judged.metric}", head, tuple(rows))


def _ratio(verdict: Verdict) -> str:
    """With its interval, which one run does not have."""
    ratio, low, high = verdict.ratio
    if verdict.compared == 0:
        return "–"
    return f"{ratio:.3f} [{low:.3f}, {high:.3f}]" if verdict.compared > 1 else f"{ratio:.3f}"


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench compare``."""
    suite_options(parser)
    parser.add_argument("estimators", nargs="*", metavar="ID", help="which of the suite's; all by default")
    parser.add_argument("--metric", default=RANKED_BY, help="lower is better (%(default)s)")
    parser.add_argument("--fault", default=CLEAN, help="under which fault (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """One sentence per pair, then the numbers."""
    _, results = stored_results(arguments)
    chosen = [one for one in results if not arguments.estimators or one.cell.contestant.id in arguments.estimators]
    _require(arguments, results)
    judged = comparison(chosen, arguments.metric, arguments.fault)
    for verdict in judged.verdicts:
        sys.stdout.write(f"{verdict.sentence}\n")
    print_sheets([sheet(judged)])
    return 0


def _require(arguments: argparse.Namespace, results: Sequence[Result]) -> None:
    ids = {result.cell.contestant.id for result in results}
    faults = {result.cell.fault.id for result in results}
    for what, asked, known in (
        ("estimator", arguments.estimators, ids),
        ("fault", [arguments.fault], faults),
    ):
        for one in asked:
            if one not in known:
                raise ParameterError(f"the suite has no {what} {one!r}; {did_you_mean(one, sorted(known))}")
    require_metric(arguments.metric, results)
    require_lower_is_better(arguments.metric)
    if len(ids) < 2 or len(set(arguments.estimators)) == 1:
        raise ParameterError("one estimator alone is better than none; name two or more, or none for all of the suite")
