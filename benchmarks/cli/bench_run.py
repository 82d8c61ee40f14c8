"""``fusion bench run``: compute what is missing of a suite, and print what came out."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence

from benchmarks.cli.suite_arguments import opened, suite_options
from benchmarks.runner.gate import Outcome
from benchmarks.runner.leaderboard import suite_leaderboard
from benchmarks.runner.results import Result, partly_headed, warnings
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.scoring import ALIVE
from benchmarks.runner.suite import CLEAN
from fusion.cli.arguments import at_least_one
from fusion.output.progress import progress_bar
from fusion.output.tables import print_tables


def lost(results: Sequence[Result]) -> list[str]:
    """A sentence for each status with which estimators ended that have no score in some cells, and its first reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for one in results:
        if one.status not in ALIVE:
            reasons.setdefault((one.cell.estimator.id, one.status), []).append(one.error or one.status)
    return [f"{name} lost {len(own)} of its cells: {_first(own)}" for (name, _), own in reasons.items()]


def _first(reasons: Sequence[str]) -> str:
    others = len(set(reasons)) - 1
    return reasons[0] + (f" (and {others} more reasons; `fusion bench report` lists all)" if others else "")


def remarks(results: Sequence[Result]) -> list[str]:
    """One sentence for each run whose truth has a heading at some instants only."""
    sentences = {one.run: partly_headed(one) for one in results if one.cell.fault.id == CLEAN}
    return [f"{run}: {sentence}" for run, sentence in sentences.items() if sentence]


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench run``."""
    suite_options(parser)
    parser.add_argument("-j", "--workers", type=at_least_one, metavar="N", help="processes; one per core by default")
    parser.add_argument("--shard", type=_shard, metavar="I/N", help="only the I-th of N parts, by key")
    parser.add_argument("--dask", metavar="ADDRESS", help="carry the cells out on this Dask scheduler")


def _shard(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if not (number.isdigit() and count.isdigit() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text!r}: give I/N, as in 1/4 for the first of four parts")
    return int(number), int(count)


def run(arguments: argparse.Namespace) -> int:
    """Run, print the leaderboard. Exit code 1 when no cell survived, 3 when none was measured."""
    suite, store = opened(arguments)
    with progress_bar("bench run") as progress:
        results = run_suite(
            suite, store, workers=arguments.workers, part=arguments.shard, dask=arguments.dask, progress=progress
        )
    if not results:
        return Outcome.NOT_MEASURED
    counted = Counter(result.status for result in results)
    sys.stderr.write(
        f"fusion bench run: {', '.join(f'{count} {status}' for status, count in sorted(counted.items()))}\n"
    )
    for reason in (*warnings(results), *lost(results), *remarks(results)):
        sys.stderr.write(f"fusion bench run: {reason}\n")
    print_tables([suite_leaderboard(results)])
    return 0 if any(result.status in ALIVE for result in results) else 1
