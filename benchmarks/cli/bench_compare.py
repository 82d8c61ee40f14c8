"""``fusion bench compare``: which estimator is better on these runs, or that they are inconclusive."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks.cli.suite_arguments import stored_results, suite_options
from benchmarks.metrics.catalogue import RANKED_BY, require_lower_is_better
from benchmarks.runner.leaderboard import pair_table
from benchmarks.runner.results import Result, comparison, require_metric
from benchmarks.runner.suite import CLEAN
from fusion import ParameterError
from fusion.errors import did_you_mean
from fusion.output.tables import print_tables


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench compare``."""
    suite_options(parser)
    parser.add_argument("estimators", nargs="*", metavar="ID", help="which of the suite's; all by default")
    parser.add_argument("--metric", default=RANKED_BY, help="lower is better (%(default)s)")
    parser.add_argument("--fault", default=CLEAN, help="under which fault (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """One sentence per pair, then the numbers."""
    _, results = stored_results(arguments)
    chosen = [one for one in results if not arguments.estimators or one.cell.estimator.id in arguments.estimators]
    _require(arguments, results)
    judged = comparison(chosen, arguments.metric, arguments.fault)
    for verdict in judged.verdicts:
        sys.stdout.write(f"{verdict.sentence}\n")
    print_tables([pair_table(judged)])
    return 0


def _require(arguments: argparse.Namespace, results: Sequence[Result]) -> None:
    ids = {result.cell.estimator.id for result in results}
    faults = {result.cell.fault.id for result in results}
    for what, asked, known in (("estimator", arguments.estimators, ids), ("fault", [arguments.fault], faults)):
        for one in asked:
            if one not in known:
                raise ParameterError(f"the suite has no {what} {one!r}; {did_you_mean(one, sorted(known))}")
    require_metric(arguments.metric, results)
    require_lower_is_better(arguments.metric)
    if len(ids) < 2 or len(set(arguments.estimators)) == 1:
        raise ParameterError("one estimator alone is better than none; name two or more, or none for all of the suite")
