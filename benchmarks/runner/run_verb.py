"""``fusion bench run``: compute what is missing of a suite, and print what came out."""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence

from benchmarks.arguments import at_least_one
from benchmarks.cell import ALIVE
from benchmarks.progress import Progress, progress_bar
from benchmarks.runner.definition import CLEAN, Suite
from benchmarks.runner.execute import Done, execute
from benchmarks.runner.plan import Cell, cells_of, missing, shard
from benchmarks.runner.plan_verb import opened, suite_options
from benchmarks.runner.refusals import refuse_impossible
from benchmarks.runner.results import Result, leaderboard, read_results, warnings
from benchmarks.runner.store import Store
from benchmarks.sheet import print_sheets
from benchmarks.table import partly_headed
from benchmarks.workers import Limits


def run_suite(
    suite: Suite,
    store: Store,
    *,
    workers: int | None = None,
    part: tuple[int, int] | None = None,
    dask: str | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Compute what is missing and answer the results of the whole suite that are there then.

    ``part``: number and count of a shard, from 1. ``dask``: the address of a scheduler that carries the cells out.
    What can be refused is, before any work. The same results whatever the workers, their order, or how often it was
    interrupted.
    """
    cells = cells_of(suite, store)
    wanted = cells if part is None else shard(cells, *part)
    open_cells = missing(wanted, store)
    refuse_impossible(open_cells.estimates)
    todo = [*open_cells.estimates, *open_cells.scores]
    for done, one in enumerate(_carried_out(todo, suite, store, workers, dask), start=1):
        if progress is not None:
            progress(done, len(todo), f"{one.cell.run.id} {one.cell.contestant.id}")
    return read_results(cells, store)


def _carried_out(
    todo: Sequence[Cell], suite: Suite, store: Store, workers: int | None, dask: str | None
) -> Iterator[Done]:
    if not todo:
        return iter(())
    limits = Limits(suite.limits.wall_s, suite.limits.rss_mb)
    if dask is not None:
        from benchmarks.runner.cluster import execute_on_dask

        return execute_on_dask(todo, store, dask, limits)
    count = os.cpu_count() or 1 if workers is None else workers
    return execute(todo, store, workers=min(count, len(todo)), limits=limits)


def lost(results: Sequence[Result]) -> list[str]:
    """Why contestants have no score in some cells: a sentence for each status they ended with, and its first reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for one in results:
        if one.status not in ALIVE:
            reasons.setdefault((one.cell.contestant.id, one.status), []).append(one.error or one.status)
    return [f"{name} lost {len(own)} of its cells: {_first(own)}" for (name, _), own in reasons.items()]


def _first(reasons: Sequence[str]) -> str:
    others = len(set(reasons)) - 1
    return reasons[0] + (f" (and {others} more reasons; `fusion bench report` lists all)" if others else "")


def remarks(results: Sequence[Result]) -> list[str]:
    """Where the truth of a run has a heading at some instants only, one sentence for each run."""
    told = [(one.cell.run.id, partly_headed(one.metrics)) for one in results if one.cell.fault.id == CLEAN]
    return [f"{run}: {sentence}" for run, sentence in dict(told).items() if sentence]


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
        return 3
    counted = Counter(result.status for result in results)
    sys.stderr.write(
        f"fusion bench run: {', '.join(f'{count} {status}' for status, count in sorted(counted.items()))}\n"
    )
    for reason in (*warnings(results), *lost(results), *remarks(results)):
        sys.stderr.write(f"fusion bench run: {reason}\n")
    print_sheets([leaderboard(results)])
    return 0 if any(result.status in ALIVE for result in results) else 1
