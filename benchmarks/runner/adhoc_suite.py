"""Estimators scored on logs, without a suite file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fusion
from benchmarks.cell import STATUSES, Cell, Score, cached_run, crashed, score_cell
from benchmarks.metrics.score import pool
from benchmarks.runner.workers import TaskFailure, compute
from fusion import LogError
from fusion.cli.options import Settings, require_estimators, require_settings
from fusion.output.files import write_json
from fusion.output.progress import Progress

POOLED = "all runs"


LOST = "the worker process died, twice; run it alone with --workers 1 to see why"


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


def _lost(cell: Cell, _: TaskFailure) -> Score:
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


def remarks(scores: Sequence[Score]) -> list[str]:
    """What the tables cannot show: logs without truth, warnings of logs, why an estimator was lost."""
    from benchmarks.runner.leaderboard import partly_headed

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
