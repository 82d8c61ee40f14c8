"""``fusion bench replay``: make one cell of a suite again, as a log with its faults for `fusion review`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from benchmarks.replay import write_replay
from benchmarks.runner.definition import CLEAN, Suite
from benchmarks.runner.execute import faulty_run, fold
from benchmarks.runner.plan import Cell, cells_of
from benchmarks.runner.plan_verb import opened, suite_options
from benchmarks.runner.store import Store
from benchmarks.runner.verify_verb import NOT_DETERMINISTIC
from fusion import SuiteError
from fusion.errors import did_you_mean

Item = TypeVar("Item")


def one_cell(suite: Suite, store: Store, run: str, estimator: str, *, fault: str = CLEAN, seed: int = 0) -> Cell:
    """The cell of a suite by the ids of what it is made of; raises `SuiteError` that names the nearest."""
    contestants = _found("estimator", estimator, {one.id: one for one in suite.contestants})
    faults = _found("fault", fault, {one.id: one for one in suite.faults})
    if not 0 <= seed < suite.seeds:
        raise SuiteError(f"{suite.name}: there is no seed {seed}; its seeds are 0 to {suite.seeds - 1}")
    return cells_of(replace(suite, runs=(suite.run(run),), contestants=contestants, faults=faults), store)[seed]


def _found(what: str, wanted: str, known: Mapping[str, Item]) -> tuple[Item]:
    if wanted not in known:
        raise SuiteError(f"the suite has no {what} {wanted!r}; {did_you_mean(wanted, known)}")
    return (known[wanted],)


def replay_cell(cell: Cell, output: Path) -> str:
    """Fold the run of ``cell``, faults and all, through its contestant; write what was measured and said as a log, and
    answer the digest: "" where the contestant crashed, which the log then shows up to that moment.
    """
    run = faulty_run(cell)
    lane = fold(cell, run)
    about = {"estimator": cell.contestant.use, "seed": str(cell.seed), "fault": cell.fault.id, "digest": lane.digest}
    parameters = json.dumps(dict(cell.contestant.params), sort_keys=True)
    write_replay(run, lane, output, {**run.metadata, **about, "parameters": parameters})
    return lane.digest


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
        told = f"in the store it was lost: {kept['error']}" if kept["error"] else "the same to the bit as in the store"
        sys.stderr.write(f"fusion bench replay: {told}\n")
        return 0
    sys.stderr.write(f"fusion bench replay: {cell} is not what it was: {digest} now, {kept['digest']} in the store\n")
    return NOT_DETERMINISTIC
