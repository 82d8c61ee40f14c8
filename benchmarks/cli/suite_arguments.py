"""Arguments that the verbs of suites share, and what they name."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.metrics.families import families
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import Result, read_results
from benchmarks.runner.store import STORE, Store
from benchmarks.runner.suite import Suite
from benchmarks.runner.suite_file import load_suite
from fusion import SuiteError


def suite_options(parser: argparse.ArgumentParser) -> None:
    """The arguments of every verb of a suite."""
    parser.add_argument(
        "suite",
        type=Path,
        metavar="SUITE",
        help="a suite file (TOML), or a built-in suite by name: quick, synthetic, paper, real",
    )
    parser.add_argument("--store", type=Path, default=STORE, metavar="FOLDER", help="where results are (%(default)s)")


def opened(arguments: argparse.Namespace) -> tuple[Suite, Store]:
    """The suite and the store of `suite_options`; estimators and metrics that are left out go to stderr."""
    suite = load_suite(arguments.suite)
    for sentence in (*suite.left_out, *families().refused):
        sys.stderr.write(f"fusion bench: {sentence}\n")
    return suite, Store(arguments.store)


def stored_results(arguments: argparse.Namespace) -> tuple[Suite, list[Result]]:
    """The suite and its results; raises `SuiteError` while some are missing."""
    suite, store = opened(arguments)
    cells = cells_of(suite, store)
    results = read_results(cells, store)
    if len(results) < len(cells):
        have = f"{suite.name}: {len(results)} of {len(cells)} cells are there"
        raise SuiteError(f"{have}; run `fusion bench run` first")
    return suite, results
