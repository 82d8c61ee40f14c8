"""The file of a suite: TOML with nothing but data, read once and checked whole before any work.

Paths in it are relative to it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from benchmarks.runner.suite import (
    CLEAN,
    INCONCLUSIVE,
    READINGS,
    TEST,
    TUNE,
    CellLimits,
    EstimatorSpec,
    Evaluation,
    FaultSet,
    Gate,
    RunSource,
    Suite,
    builtin_suites,
)
from fusion import NotInstalledError, SuiteError, WorldError, load
from fusion.errors import did_you_mean
from fusion.plugins import in_sentences
from fusion.schema import read_record


@dataclass(frozen=True, slots=True)
class _Head:
    name: str
    seed: int = 0
    seeds: int = 1
    eval: Evaluation = field(default_factory=Evaluation)
    limits: CellLimits = field(default_factory=CellLimits)
    topics: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _File:
    """The suite as it is written."""

    suite: _Head
    runs: tuple[RunSource, ...]
    estimators: tuple[EstimatorSpec, ...]
    faults: tuple[FaultSet, ...] = ()
    gate: Gate = field(default_factory=Gate)


def load_suite(path: Path) -> Suite:
    """The suite in a TOML file, or a built-in one by name; raises `SuiteError` that names the wrong place, and
    `PluginError` for an optional estimator that is not there for another reason than its package.
    """
    if not path.suffix and not path.exists():
        known = builtin_suites()
        if str(path) not in known:
            raise SuiteError(f"there is no suite {str(path)!r}; {did_you_mean(str(path), known)}")
        path = known[str(path)]
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        written = read_record(_File, table, str(path))
    except OSError as error:
        raise SuiteError(f"{path}: cannot be read ({error.strerror}); give a suite file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SuiteError(f"{path}: not TOML: {error}; correct that line") from error
    except WorldError as error:
        raise SuiteError(str(error)) from error
    return _checked(written, path)


def _checked(written: _File, path: Path) -> Suite:
    head = written.suite
    _check_parameters(written, path)
    absent = _absent(written.estimators)
    present = [one for one in written.estimators if not (one.optional and one.use in absent)]
    estimators = tuple(each for estimator in present for each in estimator.combinations())
    left_out = in_sentences(absent.values())
    if absent and not estimators:
        raise SuiteError(f"{path}: estimators: none of them is installed: {'; '.join(left_out)}")
    faults = (FaultSet(CLEAN), *written.faults)
    for what, items in (("runs", written.runs), ("estimators", estimators), ("faults", faults)):
        _require_unique([item.id for item in items], f"{path}: {what}")
    for number, run in enumerate(written.runs):
        _check_run(run, f"{path}: runs[{number}] ({run.id})")
    _check_head(head, f"{path}: suite")
    _check_tuning(written, path)
    _require_one_of(written.gate.inconclusive, INCONCLUSIVE, f"{path}: gate.inconclusive")
    runs = tuple(replace(run, topics={**head.topics, **run.topics}) for run in written.runs)
    return Suite(
        head.name,
        head.seed,
        head.seeds,
        head.eval,
        head.limits,
        runs,
        estimators,
        faults,
        written.gate,
        path.resolve(),
        tuple(left_out),
    )


def _absent(estimators: Sequence[EstimatorSpec]) -> dict[str, NotInstalledError]:
    """The errors of optional estimators that are not there, by the name they use."""
    absent = {}
    for name in dict.fromkeys(estimator.use for estimator in estimators if estimator.optional):
        try:
            load(name)
        except NotInstalledError as error:
            absent[name] = error
    return absent


def _require_unique(ids: Sequence[str], where: str) -> None:
    if not ids:
        raise SuiteError(f"{where}: none given; a suite needs at least one")
    for number, one in enumerate(ids):
        if not one:
            raise SuiteError(f"{where}[{number}]: the id is empty; give it one")
        if one in ids[:number]:
            raise SuiteError(f"{where}: the id {one!r} is given twice; give each its own")


def _check_run(run: RunSource, where: str) -> None:
    if (run.mcap is None) == (run.scenario is None):
        raise SuiteError(f"{where}: give either mcap, a log, or scenario, a simulated run")
    if run.topics and run.world is None:
        raise SuiteError(f"{where}: topics are of a foreign bag, which needs a world too; our own logs need neither")
    if run.scenario is None and (run.seed != 0 or run.duration_s is not None):
        raise SuiteError(f"{where}: seed and duration_s are of a simulated run, a log is taken whole; leave them out")
    if run.world is None and any(run.truth_to_map):
        raise SuiteError(f"{where}: truth_to_map is of a foreign bag, which needs a world too; leave it out")
    if run.seed < 0:
        raise SuiteError(f"{where}.seed: {run.seed} is below 0; give 0 or more")
    if run.duration_s is not None:
        _require_above_zero(where, duration_s=run.duration_s)
    _require_one_of(run.split, (TUNE, TEST), f"{where}.split")


def _check_head(head: _Head, where: str) -> None:
    if head.seeds < 1 or head.seed < 0:
        raise SuiteError(f"{where}: {head.seeds} seeds from seed {head.seed}; give 1 or more, from a seed not below 0")
    rules, limits = head.eval, head.limits
    _require_one_of(rules.reading, READINGS, f"{where}.eval.reading")
    _require_above_zero(f"{where}.eval", hz=rules.hz, max_age_s=rules.max_age_s, gap_s=rules.gap_s)
    _require_above_zero(f"{where}.limits", wall_s=limits.wall_s, rss_mb=limits.rss_mb)


def _require_above_zero(where: str, **numbers: float) -> None:
    for name, number in numbers.items():
        if not number > 0.0:
            raise SuiteError(f"{where}.{name}: {number:g} is not above 0; give a greater number")


def _require_one_of(word: str, known: Sequence[str], where: str) -> None:
    if word not in known:
        raise SuiteError(f"{where}: {word!r} does not exist; {did_you_mean(word, known)}")


def _check_parameters(written: _File, path: Path) -> None:
    """A grid without a value would make no estimator at all, and what is no number has no place in a key."""
    for estimator in written.estimators:
        for name, values in estimator.grid.items():
            if not values:
                raise SuiteError(f"{path}: {estimator.id}: grid.{name} is empty; give its values, or leave it out")
        given = [*estimator.params.items(), *((name, one) for name, own in estimator.grid.items() for one in own)]
        for name, value in given:
            if isinstance(value, float) and not math.isfinite(value):
                raise SuiteError(f"{path}: {estimator.id}: {name} is {value}, not a finite number; give one")


def _check_tuning(written: _File, path: Path) -> None:
    """Nothing is judged on what it was tuned on."""
    splits = {run.id: run.split for run in written.runs}
    for estimator in written.estimators:
        for run_id in estimator.tuned_on:
            if run_id not in splits:
                raise SuiteError(f"{path}: {estimator.id} is tuned on {run_id!r}; {did_you_mean(run_id, splits)}")
            if splits[run_id] == TEST:
                raise SuiteError(
                    f"{path}: {estimator.id} was tuned on {run_id}, which is a test run: its score there would be "
                    'worth nothing; give that run split = "tune"'
                )
