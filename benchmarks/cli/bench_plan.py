"""``fusion bench plan``: what a suite would compute, and what of it is there already."""

from __future__ import annotations

import argparse
import json
import sys

from benchmarks.cli.suite_arguments import opened, suite_options
from benchmarks.runner.plan import cells_of, missing
from benchmarks.runner.preflight import refuse_impossible


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench plan``."""
    suite_options(parser)
    parser.add_argument("--json", action="store_true", help="counts and keys for a program")


def run(arguments: argparse.Namespace) -> int:
    """Count the cells; with ``--json`` name them."""
    suite, store = opened(arguments)
    cells = cells_of(suite, store)
    open_cells = missing(cells, store)
    refuse_impossible(open_cells.estimates)
    counts = {
        "suite": suite.name,
        "cells": len(cells),
        "missing_estimates": len(open_cells.estimates),
        "missing_scores": len(open_cells.scores),
        "cached": len(cells) - len(open_cells.estimates) - len(open_cells.scores),
    }
    if arguments.json:
        keys = [{"cell": str(cell), "estimate": cell.estimate_key, "score": cell.score_key} for cell in cells]
        sys.stdout.write(json.dumps({**counts, "keys": keys}, indent=1) + "\n")
        return 0
    sys.stdout.write(
        f"{suite.name}: {len(suite.runs)} runs x {len(suite.estimators)} estimators x {len(suite.faults)} faults x "
        f"{suite.seeds} seeds = {len(cells)} cells\n"
        f"  {counts['cached']} cached, {counts['missing_estimates']} to compute, "
        f"{counts['missing_scores']} only to score\n"
    )
    return 0
