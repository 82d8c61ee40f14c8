"""Arguments that the verbs of suites share."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.runner.store import STORE


def suite_options(parser: argparse.ArgumentParser) -> None:
    """What every verb of a suite takes."""
    parser.add_argument(
        "suite",
        type=Path,
        metavar="SUITE",
        help="a suite file (TOML), or a built-in suite by name: quick, synthetic, paper, real",
    )
    parser.add_argument("--store", type=Path, default=STORE, metavar="FOLDER", help="where results are (%(default)s)")
