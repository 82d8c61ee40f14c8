"""Estimators scored on logs without a suite file: a suite built in memory, its store gone when it is done."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import fusion
from benchmarks.runner.leaderboard import entries, leaderboard
from benchmarks.runner.plan import unkept_cells
from benchmarks.runner.results import Result, by_run, detailed, partly_headed, read_results
from benchmarks.runner.run_suite import carry_out_cells
from benchmarks.runner.store import Store
from benchmarks.runner.suite import CLEAN, CellLimits, EstimatorSpec, Evaluation, FaultSet, Gate, RunSource, Suite
from fusion import LogError
from fusion.cli.options import Settings, require_estimators, require_settings
from fusion.output.files import write_json
from fusion.output.progress import Progress
from fusion.output.tables import Table
from logs.reader import read_world


def bench(
    runs: Sequence[Path],
    *,
    estimators: Sequence[str] | None = None,
    settings: Settings | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """The score of every estimator (None: of all available) on every run, in that order, runs first.

    Everything that can be refused is refused before any work: raises `PluginError`, `ParameterError` or `LogError`.
    ``workers`` None: one per core; 1: in this process, where alone estimators of `fusion.registered` are known.
    """
    chosen = tuple(dict.fromkeys(fusion.available() if estimators is None else estimators))
    check(runs, chosen, settings or {})
    cells = unkept_cells(adhoc_suite(runs, chosen, settings or {}), seed)
    with tempfile.TemporaryDirectory(prefix="fusion-bench-") as folder:
        store = Store(Path(folder))
        done = carry_out_cells(cells, store, None, workers=workers, progress=progress)
        cpu_s = {one.cell.estimate_key: one.carried.cpu_s for one in done}
        return [one._replace(cpu_s=cpu_s[one.cell.estimate_key]) for one in read_results(cells, store)]


def check(runs: Sequence[Path], estimators: Sequence[str], settings: Settings) -> None:
    """Refuse what is missing or misspelt."""
    require_estimators(estimators)
    for path in runs:
        require_log(path)
    if settings:
        require_settings(settings, estimators, read_world(runs[0]))


def require_log(path: Path) -> None:
    """Raises `LogError` where no file is."""
    if not path.is_file():
        raise LogError(f"{path}: no such file; give an MCAP log (`fusion simulate` makes one)")


def adhoc_suite(runs: Sequence[Path], estimators: Sequence[str], settings: Settings) -> Suite:
    """The suite of these logs and estimators, each with its ``settings``, of one seed and without a fault."""
    unique = dict.fromkeys(runs)
    stems = [path.stem for path in unique]
    ids = [path.stem if stems.count(path.stem) == 1 else str(path) for path in unique]
    return Suite(
        name="bench",
        seed=0,
        seeds=1,
        evaluation=Evaluation(),
        limits=CellLimits(),
        runs=tuple(RunSource(name, mcap=str(path)) for name, path in zip(ids, unique, strict=True)),
        estimators=tuple(EstimatorSpec(name, name, dict(settings.get(name, {}))) for name in estimators),
        faults=(FaultSet(CLEAN),),
        gate=Gate(),
        path=Path("bench.toml").resolve(),
    )


def tables(results: Sequence[Result]) -> list[Table]:
    """A leaderboard for each run, and one over those with truth where these are several."""
    each = by_run(results)
    made = []
    for run, own in each.items():
        title = run if own[0].has_truth else f"{run}, without truth"
        made.append(leaderboard(title, entries(own)))
    scored = sum(own[0].has_truth for own in each.values())
    if scored > 1:
        which = f"all {scored} runs" if scored == len(each) else f"the {scored} runs with truth"
        made.append(leaderboard(f"{which}: medians over runs", entries(results)))
    return made


def remarks(results: Sequence[Result]) -> list[str]:
    """A sentence for everything that the tables cannot show: warnings of logs, logs without truth, lost estimators."""
    return list(dict.fromkeys(sentence for result in results for sentence in _remarks(result)))


def _remarks(result: Result) -> Iterator[str]:
    for warning in result.warnings:
        yield f"{result.run}: {warning}"
    if sentence := partly_headed(result):
        yield f"{result.run}: {sentence}"
    if not result.has_truth:
        yield f"{result.run} holds no ground truth: no errors are scored, only NIS, availability and time"
    if result.error is not None:
        yield f"{result.run}: {result.estimator} {result.status}: {result.error}"


def write_records(results: Sequence[Result], output: Path) -> None:
    """Everything that is known of each result as one JSON list; ``-`` is stdout."""
    write_json(output, [detailed(result) for result in results], indent=1)
