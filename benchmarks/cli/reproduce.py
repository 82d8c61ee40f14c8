"""``fusion reproduce``: the paper's experiments run again, and its claims judged."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.paper.claims import in_words
from benchmarks.paper.environment_files import write_calibrated
from benchmarks.paper.page import write_html, write_markdown, write_png
from benchmarks.paper.report import Report
from benchmarks.paper.reproduce import TRIALS, reproduce
from fusion.cli.arguments import at_least_one, not_negative
from fusion.output.figures import require_matplotlib
from fusion.output.files import require_place, write_json
from fusion.output.progress import progress_bar
from fusion.output.tables import print_tables
from fusion.plugins import left_out

Writer = Callable[[Report, Path], object]


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion reproduce``."""
    parser.add_argument("--trials", type=at_least_one, default=TRIALS, metavar="N", help="runs each (%(default)s)")
    parser.add_argument(
        "--seed", type=not_negative, default=0, metavar="S", help="of the first run; the next counts one up"
    )
    parser.add_argument(
        "--estimators",
        metavar="A,B",
        help="those beside the paper's curves and the EKF; all of this package by default",
    )
    parser.add_argument("--json", type=Path, metavar="F", help="every number, in metres")
    parser.add_argument("--html", type=Path, metavar="F", help="the whole page in one file, figures in it")
    parser.add_argument("--png", type=Path, metavar="F", help="the paper's result figures")
    parser.add_argument("--markdown", type=Path, metavar="F", help="the page, its figures beside it: docs/paper.md")
    parser.add_argument("--workers", type=at_least_one, metavar="N", help="processes; one per core by default")
    parser.add_argument("--scenarios", type=Path, metavar="FOLDER", help="scenarios that --calibrate has written")
    parser.add_argument(
        "--calibrate",
        type=Path,
        metavar="FOLDER",
        help="solve for what the paper does not give, write scenarios there, and do nothing else; some 20 minutes",
    )


def run(arguments: argparse.Namespace) -> int:
    """Calibrate; or run, print, write."""
    if arguments.calibrate is not None:
        workers = arguments.workers or os.cpu_count() or 1
        for path in write_calibrated(
            arguments.calibrate, scenarios=arguments.scenarios, workers=workers, report=_report
        ):
            sys.stdout.write(f"{path}\n")
        return 0
    writers = _writers(arguments)
    with progress_bar("reproduce") as progress:
        report = reproduce(
            arguments.trials,
            seed=arguments.seed,
            scenarios=arguments.scenarios,
            estimators=None if arguments.estimators is None else arguments.estimators.split(","),
            workers=arguments.workers,
            progress=progress,
        )
    for remark in (*(left_out() if arguments.estimators is None else ()), *report.remarks):
        _report(remark)
    print_tables(list(report.tables.values()))
    sys.stdout.write(f"{in_words(report.judged)}\n")
    for path, writer in writers:
        writer(report, path)
        sys.stdout.write(f"{path}\n")
    return 0


def _writers(arguments: argparse.Namespace) -> list[tuple[Path, Writer]]:
    """Places and writers of the results. Their needs are checked before minutes are spent."""
    drawn: list[tuple[Path | None, Writer]] = [
        (arguments.html, write_html),
        (arguments.png, write_png),
        (arguments.markdown, write_markdown),
    ]
    if any(path for path, _ in drawn):
        require_matplotlib()
    wanted = [(path, writer) for path, writer in [(arguments.json, _write_json), *drawn] if path is not None]
    for path, _ in wanted:
        require_place(path)
    return wanted


def _write_json(report: Report, path: Path) -> None:
    write_json(path, report.record())


def _report(what: str) -> None:
    sys.stderr.write(f"fusion reproduce: {what}\n")
