"""``fusion bench replay``: make one cell of a suite again, as a log with its faults for `fusion review`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.cli.suite_arguments import opened, suite_options
from benchmarks.runner.gate import Outcome
from benchmarks.runner.replay_log import one_cell, replay_cell
from benchmarks.runner.suite import CLEAN


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench replay``."""
    suite_options(parser)
    parser.add_argument("run", metavar="RUN", help="the id of a run of the suite")
    parser.add_argument("estimator", metavar="ESTIMATOR", help="the id of one of its estimators")
    parser.add_argument("--fault", default=CLEAN, metavar="ID", help="one of its faults (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="one of its seeds (%(default)s)")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUT", help="the log to write (*.mcap)")


def run(arguments: argparse.Namespace) -> int:
    """Replay, and compare with what is in the store. Exit code 5 when that is something else."""
    suite, store = opened(arguments)
    cell = one_cell(suite, store, arguments.run, arguments.estimator, fault=arguments.fault, seed=arguments.seed)
    digest = replay_cell(cell, arguments.output)
    sys.stdout.write(f"{arguments.output}\n")
    if not store.has("estimates", cell.estimate_key):
        return 0
    kept = store.read_json("estimates", cell.estimate_key, "result.json")
    if kept["error"] or kept["digest"] == digest:
        lost = f"in the store it was lost: {kept['error']}"
        sys.stderr.write(f"fusion bench replay: {lost if kept['error'] else 'the same to the bit as in the store'}\n")
        return 0
    sys.stderr.write(f"fusion bench replay: {cell} is not what it was: {digest} now, {kept['digest']} in the store\n")
    return Outcome.NOT_DETERMINISTIC
