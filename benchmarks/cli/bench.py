"""``fusion bench``: score estimators on recorded runs, all on the same measurements from the same start."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.metrics.families import families
from benchmarks.runner.adhoc_suite import bench, remarks, tables, write_records
from fusion.cli.arguments import at_least_one, estimator_options, not_negative
from fusion.cli.options import parse_settings
from fusion.output.progress import progress_bar
from fusion.output.tables import print_tables
from fusion.plugins import left_out


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench``."""
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="MCAP logs")
    estimator_options(parser)
    parser.add_argument("--json", type=Path, metavar="OUT", help="write one record per run and estimator; - for stdout")
    parser.add_argument("--seed", type=not_negative, default=0, help="of the estimators that draw random numbers")
    parser.add_argument("--workers", type=at_least_one, metavar="N", help="processes; one per core by default")


def run(arguments: argparse.Namespace) -> int:
    """Bench, print the tables, write the records. Exit code 1 when no estimator survived."""
    chosen = None if arguments.estimators is None else arguments.estimators.split(",")
    with progress_bar("bench") as progress:
        results = bench(
            arguments.runs,
            estimators=chosen,
            settings=parse_settings(arguments.set),
            seed=arguments.seed,
            workers=arguments.workers,
            progress=progress,
        )
    for remark in (*(left_out() if chosen is None else ()), *families().refused, *remarks(results)):
        sys.stderr.write(f"fusion bench: {remark}\n")
    if arguments.json != Path("-"):
        print_tables(tables(results))
    if arguments.json is not None:
        write_records(results, arguments.json)
    return 1 if all(result.status == "crashed" for result in results) else 0
