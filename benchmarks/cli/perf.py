"""``fusion perf``: the speed of the estimators beside filterpy, and the laws by which cost grows."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from fusion.cli.arguments import at_least_one

MINUTES, ROUNDS = 3.0, 5


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion perf``."""
    parser.add_argument(
        "--minutes",
        type=_minutes,
        default=MINUTES,
        metavar="M",
        help="length of the log (%(default)s); 60: the hour log",
    )
    parser.add_argument("--rounds", type=at_least_one, default=ROUNDS, metavar="N", help="that count (%(default)s)")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write every number as one record; - for stdout")
    parser.add_argument("--markdown", type=Path, metavar="OUT", help="write the tables as Markdown; - for stdout")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print the tables, write the record and the page."""
    from benchmarks.performance.perf import measure
    from benchmarks.performance.table import markdown, tables, verdict
    from fusion.output.files import require_place, write, write_json
    from fusion.output.progress import progress_bar
    from fusion.output.tables import print_tables

    outputs = [path for path in (arguments.json, arguments.markdown) if path is not None]
    for path in outputs:
        require_place(path)
    with progress_bar("perf") as progress:
        measured = measure(arguments.minutes, arguments.rounds, progress)
    if measured.missing is not None:
        sys.stderr.write(f"fusion perf: {measured.missing}\n")
    if Path("-") not in outputs:
        print_tables(tables(measured))
    sys.stderr.write(f"fusion perf: {verdict(measured)}\n")
    if arguments.json is not None:
        write_json(arguments.json, measured.record(), indent=1)
    if arguments.markdown is not None:
        write(arguments.markdown, markdown(measured).encode())
    return 0


def _minutes(text: str) -> float:
    try:
        minutes = float(text)
    except ValueError:
        minutes = math.nan
    if not 0.05 <= minutes <= 600.0:
        raise argparse.ArgumentTypeError(f"{text} is no length of a log; give minutes from 0.05 to 600")
    return minutes
