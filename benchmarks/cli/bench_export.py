"""``fusion bench export``: the results of a suite for other programs: JSON, CSV, LaTeX, Markdown, JUnit."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.cli.suite_arguments import stored_results, suite_options
from benchmarks.runner.export import WRITERS
from fusion import ParameterError


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench export``."""
    suite_options(parser)
    for kind, (_, what) in WRITERS.items():
        parser.add_argument(f"--{kind}", type=Path, metavar="F", help=f"{what}; - for stdout")


def run(arguments: argparse.Namespace) -> int:
    """Write what is asked for; raises `ParameterError` when that is nothing."""
    suite, results = stored_results(arguments)
    if all(getattr(arguments, kind) is None for kind in WRITERS):
        raise ParameterError(f"nothing is asked for; give at least one of --{', --'.join(WRITERS)}")
    for kind, (writer, _) in WRITERS.items():
        path = getattr(arguments, kind)
        if path is not None:
            writer(suite, results, path)
            if path != Path("-"):
                sys.stdout.write(f"{path}\n")
    return 0
