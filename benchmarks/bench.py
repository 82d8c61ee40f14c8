"""``fusion bench``: score estimators on recorded runs, all on the same measurements from the same start."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fusion
from benchmarks.arguments import at_least_one, not_negative
from benchmarks.cell import STATUSES, Cell, Score, cached_run, crashed, score_cell
from benchmarks.metrics.score import pool
from benchmarks.output import write_json
from benchmarks.progress import Progress, progress_bar
from benchmarks.workers import Loss, compute
from fusion import LogError, ParameterError, World
from fusion.errors import did_you_mean
from fusion.options import parse_value
from fusion.plugins import left_out

POOLED = "all runs"
LOST = "the worker process died, twice; run it alone with --workers 1 to see why"

Settings = Mapping[str, Mapping[str, object]]
"""Parameters by estimator."""


def bench(
    runs: Sequence[Path],
    *,
    estimators: Sequence[str] | None = None,
    settings: Settings | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[Score]:
    """The score of every estimator (None: of all available) on every run, in that order, runs first.

    Everything that can be refused is refused before any work: raises `PluginError`, `ParameterError` or `LogError`.
    ``workers`` None: one per core; 1: in this process, where alone estimators of `fusion.registered` are known.
    """
    chosen = tuple(dict.fromkeys(fusion.available() if estimators is None else estimators))
    check(runs, chosen, settings or {})
    cells = [Cell(path, name, dict((settings or {}).get(name, {})), seed) for path in runs for name in chosen]
    workers = min(os.cpu_count() or 1 if workers is None else workers, len(cells))
    scores: dict[int, Score] = {}
    for index, score in compute(score_cell, _lost, cells, workers):
        scores[index] = score
        if progress is not None:
            progress(len(scores), len(cells), f"{score.run} {score.estimator}")
    return [scores[index] for index in sorted(scores)]


def _lost(cell: Cell, _: Loss) -> Score:
    return crashed(cell, LOST)


def check(runs: Sequence[Path], estimators: Sequence[str], settings: Settings) -> None:
    """Refuse what is missing or misspelt."""
    require_estimators(estimators)
    for path in runs:
        require_log(path)
    if settings:
        require_settings(settings, estimators, cached_run(runs[0]).world)


def require_log(path: Path) -> None:
    """Raises `LogError` where no file is."""
    if not path.is_file():
        raise LogError(f"{path}: no such file; give an MCAP log (`fusion simulate` makes one)")


def require_estimators(estimators: Sequence[str]) -> None:
    """Raises `PluginError` for one that cannot be brought in, `NotInstalledError` where its package is missing."""
    for name in estimators:
        fusion.load(name)


def require_settings(settings: Settings, estimators: Sequence[str], world: World) -> None:
    """Raises `ParameterError` for parameters that an estimator refuses, or of one that is not chosen."""
    for name, options in settings.items():
        if name not in estimators:
            raise ParameterError(
                f"--set {name}: this estimator is not among the chosen ones; {did_you_mean(name, estimators)}"
            )
        fusion.build(name, world, options)


def pooled(scores: Sequence[Score]) -> list[Score]:
    """One score per estimator over all instants of all runs together; its status is the worst of its runs'."""
    together = []
    for name in dict.fromkeys(score.estimator for score in scores):
        own = [score for score in scores if score.estimator == name]
        measured = [score.errors for score in own if score.errors is not None]
        status = max((score.status for score in own), key=STATUSES.index)
        facts = {"cpu_per_measurement_s": _pooled_cost(own)}
        together.append(Score(POOLED, name, status, errors=pool(measured) if measured else None, facts=facts))
    return together


def _pooled_cost(scores: Sequence[Score]) -> float | None:
    """Processor time per measurement over the runs the estimator survived."""
    facts: list[Mapping[str, Any]] = [score.facts for score in scores if "cpu_s" in score.facts]
    measurements = sum(fact["measurements"] for fact in facts)
    return sum(fact["cpu_s"] for fact in facts) / measurements if measurements else None


def parse_settings(words: Sequence[str]) -> dict[str, dict[str, object]]:
    """``estimator.parameter=value`` words as parameters by estimator; a value is a JSON value, or else text.

    >>> parse_settings(["ekf.gate_probability=0.99", "ekf.mode=fast"])
    {'ekf': {'gate_probability': 0.99, 'mode': 'fast'}}
    """
    settings: dict[str, dict[str, object]] = {}
    for word in words:
        target, equals, value = word.partition("=")
        estimator, dot, parameter = target.partition(".")
        if not (equals and dot and estimator and parameter):
            raise ParameterError(f"--set {word}: expected ESTIMATOR.PARAMETER=VALUE, as in ekf.gate_probability=0.99")
        settings.setdefault(estimator, {})[parameter] = parse_value(value)
    return settings


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench``."""
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="MCAP logs")
    parser.add_argument("--estimators", metavar="A,B", help="names, separated by commas; all installed by default")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME.KEY=VALUE", help="a parameter of an estimator; repeatable"
    )
    parser.add_argument("--json", type=Path, metavar="OUT", help="write one record per run and estimator; - for stdout")
    parser.add_argument("--seed", type=not_negative, default=0, help="of the estimators that draw random numbers")
    parser.add_argument("--workers", type=at_least_one, metavar="N", help="processes; one per core by default")


def run(arguments: argparse.Namespace) -> int:
    """Bench, print the tables, write the records. Exit code 1 when no estimator survived."""
    chosen = None if arguments.estimators is None else arguments.estimators.split(",")
    with progress_bar("bench") as progress:
        scores = bench(
            arguments.runs,
            estimators=chosen,
            settings=parse_settings(arguments.set),
            seed=arguments.seed,
            workers=arguments.workers,
            progress=progress,
        )
    for remark in (*(left_out() if chosen is None else ()), *remarks(scores)):
        sys.stderr.write(f"fusion bench: {remark}\n")
    if arguments.json != Path("-"):
        from benchmarks.table import print_tables

        print_tables(scores, pooled(scores))
    if arguments.json is not None:
        write_records(scores, arguments.json)
    return 1 if all(score.status == "crashed" for score in scores) else 0


def remarks(scores: Sequence[Score]) -> list[str]:
    """What the tables cannot show: logs without truth, warnings of logs, why an estimator was lost."""
    from benchmarks.table import partly_headed

    told: list[str] = []
    for score in scores:
        warnings = score.facts["warnings"]
        if isinstance(warnings, list):
            told += [f"{score.run}: {warning}" for warning in warnings]
        if sentence := partly_headed(score.metrics):
            told.append(f"{score.run}: {sentence}")
        if score.errors is None:
            told.append(f"{score.run} holds no ground truth: no errors are scored, only NIS, availability and time")
        if score.error is not None:
            told.append(f"{score.run}: {score.estimator} {score.status}: {score.error}")
    return list(dict.fromkeys(told))


def write_records(scores: Sequence[Score], output: Path) -> None:
    """The records of `Score.record` as one JSON list; ``-`` is stdout."""
    write_json(output, [score.record() for score in scores], indent=1)
