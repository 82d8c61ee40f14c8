"""The cells of a suite, and the keys of their results, from all that these depend on."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

import fusion
from benchmarks.faults.fault import Fault
from benchmarks.faults.inject import read_fault
from benchmarks.metrics import families
from benchmarks.metrics.score import METRICS_VERSION
from benchmarks.runner.archive import ARCHIVE_VERSION
from benchmarks.runner.fingerprint import fingerprint
from benchmarks.runner.run_source import Content, content_of
from benchmarks.runner.store import Store, key_of
from benchmarks.runner.suite import CLEAN, CellLimits, EstimatorSpec, Evaluation, FaultSet, RunSource, Suite
from fusion import SuiteError
from fusion.errors import did_you_mean
from fusion.plugins import parameters


class Cell(NamedTuple):
    """One run, one estimator, one set of faults, one seed: a pure function of its spec, and its keys."""

    run: RunSource
    estimator: EstimatorSpec
    fault: FaultSet
    seed: int
    suite_seed: int
    evaluation: Evaluation
    limits: CellLimits
    folder: Path
    content: Content
    estimate_key: str
    score_key: str

    def __str__(self) -> str:
        return f"{self.run.id} {self.estimator.id} {self.fault.id} {self.seed}"


def cells_of(suite: Suite, store: Store) -> list[Cell]:
    """Every cell, run by run, so that each run is opened few times; raises before any work what can be refused."""
    made = {estimator.id: estimator_identity(estimator) for estimator in suite.estimators}
    code = {fault.id: fault_code(fault) for fault in suite.faults}
    contents = [content_of(run, suite.folder, store) for run in suite.runs]
    return _cells(suite, contents, made, code, range(suite.seeds))


def unkept_cells(suite: Suite, seed: int) -> list[Cell]:
    """Every cell with this seed, for a store that lives no longer than this process: the names of runs and estimators
    are keys enough, and no run has to be opened for them.
    """
    contents = [Content(run.id, run.id) for run in suite.runs]
    made = {estimator.id: {"estimator": estimator.id} for estimator in suite.estimators}
    return _cells(suite, contents, made, {CLEAN: []}, [seed])


def _cells(
    suite: Suite,
    contents: Sequence[Content],
    made: Mapping[str, Mapping[str, object]],
    code: Mapping[str, Sequence[str]],
    seeds: Sequence[int],
) -> list[Cell]:
    cells, rules = [], asdict(suite.evaluation)
    foreign = {f"metrics {name}": fingerprint(module) for name, module in families.modules().items()}
    for run, content in zip(suite.runs, contents, strict=True):
        judged = {"truth": content.truth, "evaluation": rules, "metrics": METRICS_VERSION, **foreign}
        for fault, estimator, seed in product(suite.faults, suite.estimators, seeds):
            spec = {**made[estimator.id], **run_identity(suite, run, fault, content, code[fault.id]), "seed": seed}
            key = key_of(spec)
            drawn = (run, estimator, fault, seed, suite.seed, suite.evaluation, suite.limits, suite.folder, content)
            cells.append(Cell(*drawn, key, key_of({"estimate": key, **judged})))
    return cells


def estimator_identity(estimator: EstimatorSpec) -> dict[str, object]:
    """The part of an estimate's key beside the run: code, parameters (those not given at their defaults), numerics."""
    made = fusion.load(estimator.use)
    known = {name: parameter.default for name, parameter in parameters(made).items()}
    for key in estimator.params:
        if key not in known:
            hint = did_you_mean(key, known)
            raise SuiteError(f"estimator {estimator.id}: {estimator.use} has no parameter {key!r}; {hint}")
    return {
        "estimator": f"{made.__module__}:{made.__qualname__}",
        "code": fingerprint(made.__module__),
        "parameters": {**known, **estimator.params},
        "numpy": np.__version__,
        "python": platform.python_version(),
        "archive": ARCHIVE_VERSION,
    }


def run_identity(
    suite: Suite, run: RunSource, fault: FaultSet, content: Content, code: Sequence[str]
) -> dict[str, object]:
    """The part of an estimate's key from the run. Faults are drawn by suite seed and run, never by estimator."""
    if fault.id == CLEAN:
        return {"measured": content.measured}
    drawn = {
        "id": fault.id,
        "apply": [dict(one) for one in fault.apply],
        "code": code,
        "run": run.id,
        "suite_seed": suite.seed,
    }
    return {"measured": content.measured, "fault": drawn}


def read_faults(faults: FaultSet) -> list[Fault]:
    """The faults of a set; raises `ParameterError` that names the one that is wrong."""
    return [read_fault(table, f"fault {faults.id}: apply[{i}]") for i, table in enumerate(faults.apply)]


def fault_code(faults: FaultSet) -> list[str]:
    """Hashes of the code of a set's faults; raises as `read_faults`."""
    return sorted({fingerprint(type(fault).__module__) for fault in read_faults(faults)})


class Missing(NamedTuple):
    """Cells of a plan that are still to be carried out."""

    estimates: list[Cell]
    scores: list[Cell]


def missing(cells: Sequence[Cell], store: Store) -> Missing:
    """The cells without an estimate that holds (`has_estimate`), and those with one but without a score."""
    estimates = [one for one in cells if not has_estimate(one, store)]
    unmade = {one.estimate_key for one in estimates}
    scores = [one for one in cells if one.estimate_key not in unmade and not store.has("scores", one.score_key)]
    return Missing(estimates, scores)


def has_estimate(cell: Cell, store: Store) -> bool:
    """True where its estimate is there, for good: one that broke a limit is void once the limit is greater."""
    if not store.has("estimates", cell.estimate_key):
        return False
    broken = store.read_json("estimates", cell.estimate_key, "result.json").get("broken_limit")
    return broken is None or getattr(cell.limits, broken["name"]) <= broken["value"]


def shard(cells: Sequence[Cell], number: int, count: int) -> list[Cell]:
    """The ``cells`` of shard ``number`` of ``count``, from 1: chosen by the keys, so that all machines agree."""
    return [one for one in cells if int(one.estimate_key[:16], 16) % count == number - 1]
