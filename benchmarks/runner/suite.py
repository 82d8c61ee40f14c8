"""A suite: which runs, which estimators with which parameters, which faults, how often, and what counts as passing.

A TOML file with nothing but data, read once and checked whole before any work. Paths in it are relative to it.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

from benchmarks.metrics.matching import MAX_AGE_S
from fusion import NotInstalledError, SuiteError, WorldError, load
from fusion.errors import did_you_mean
from fusion.plugins import in_sentences
from fusion.schema import read_record
from logs.truth import GAP_S, RATE_HZ

CATALOGUE = "catalogue"
"""The file beside the built-in suites that tells where recordings come from."""
CLEAN = "clean"
"""The fault that is none; every suite has it."""
TUNE, TEST = "tune", "test"
"""What a run is for: parameters are chosen on the first kind and judged on the second."""
READINGS = ("causal", "interp")
"""How truth and estimate are brought together."""
INCONCLUSIVE = ("fail", "warn")
"""What a gate makes of "cannot tell"."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """When estimates are judged: `benchmarks.metrics.matching`."""

    hz: float = RATE_HZ
    reading: str = "causal"
    max_age_s: float = MAX_AGE_S
    gap_s: float = GAP_S


@dataclass(frozen=True, slots=True)
class CellLimits:
    """What one cell may take: wall-clock time [s] and resident memory [MB]."""

    wall_s: float = 600.0
    rss_mb: float = 4096.0


@dataclass(frozen=True, slots=True)
class RunSource:
    """Where a run comes from: a log of ours, a foreign bag with its ``world``, or a simulated ``scenario``."""

    id: str
    mcap: str | None = None
    world: str | None = None
    topics: Mapping[str, str] = field(default_factory=dict)
    truth_to_map: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scenario: str | None = None
    seed: int = 0
    duration_s: float | None = None
    split: str = TEST
    catalogue: str | None = None
    """Where a log that is not there comes from: a set of `benchmarks/suites/catalogue.toml`."""


@dataclass(frozen=True, slots=True)
class EstimatorSpec:
    """One estimator with one set of parameters. ``use`` is its installed name; ``grid`` makes one estimator of each
    combination; ``tuned_on`` names the runs its parameters were chosen on; ``optional``: left out where its package is
    missing, where the suite would be refused otherwise.
    """

    id: str
    use: str
    params: Mapping[str, object] = field(default_factory=dict)
    grid: Mapping[str, Sequence[object]] = field(default_factory=dict)
    tuned_on: tuple[str, ...] = ()
    optional: bool = False

    def combinations(self) -> list[EstimatorSpec]:
        """One estimator per point of the grid, which it keeps: what else was tried belongs to a result."""
        if not self.grid:
            return [self]
        found = []
        for values in product(*self.grid.values()):
            chosen = dict(zip(self.grid, values, strict=True))
            suffix = ",".join(f"{key}={value}" for key, value in chosen.items())
            found.append(replace(self, id=f"{self.id}[{suffix}]", params={**self.params, **chosen}))
        return found


@dataclass(frozen=True, slots=True)
class FaultSet:
    """Faults applied together, as tables of `benchmarks.faults.inject`."""

    id: str
    apply: Sequence[Mapping[str, object]] = ()


@dataclass(frozen=True, slots=True)
class Gate:
    """What `bench gate` demands. ``ratio``: by how much a metric may grow over the baseline; ``floor``: its least
    value; ``inside``: metrics that must lie in their chi-square band; ``inconclusive``: what "cannot tell" is.
    """

    baseline: str | None = None
    ratio: Mapping[str, float] = field(default_factory=dict)
    floor: Mapping[str, float] = field(default_factory=dict)
    inside: tuple[str, ...] = ()
    inconclusive: str = "fail"


@dataclass(frozen=True, slots=True)
class _Head:
    name: str
    seed: int = 0
    seeds: int = 1
    eval: Evaluation = Evaluation()
    limits: CellLimits = CellLimits()
    topics: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _File:
    """The suite as it is written."""

    suite: _Head
    runs: tuple[RunSource, ...]
    estimators: tuple[EstimatorSpec, ...]
    faults: tuple[FaultSet, ...] = ()
    gate: Gate = Gate()


@dataclass(frozen=True, slots=True)
class Suite:
    """A suite, checked: grids are spread out, every run knows its topics, and `CLEAN` is the first of the faults.

    ``left_out``: which optional estimators are not in it and why, in sentences.
    """

    name: str
    seed: int
    seeds: int
    evaluation: Evaluation
    limits: CellLimits
    runs: tuple[RunSource, ...]
    estimators: tuple[EstimatorSpec, ...]
    faults: tuple[FaultSet, ...]
    gate: Gate
    path: Path
    left_out: tuple[str, ...] = ()

    @property
    def folder(self) -> Path:
        """Where its paths begin: beside its file, or here for a suite of the package, whose recordings are yours."""
        return Path.cwd() if self._is_builtin else self.path.parent

    @property
    def word(self) -> str:
        """What names it on a command line, wherever that is typed on this machine."""
        return self.path.stem if self._is_builtin else str(self.path)

    @property
    def _is_builtin(self) -> bool:
        return builtin_suites().get(self.path.stem) == self.path

    def run(self, run_id: str) -> RunSource:
        """The run of that id; raises `SuiteError`."""
        known = {run.id: run for run in self.runs}
        if run_id not in known:
            raise SuiteError(f"the suite has no run {run_id!r}; {did_you_mean(run_id, known)}")
        return known[run_id]


def builtin_suites() -> dict[str, Path]:
    """Suites that come with the package, by name."""
    folder = Path(__file__).parents[1] / "suites"
    return {path.stem: path for path in sorted(folder.glob("*.toml")) if path.stem != CATALOGUE}


def load_suite(path: Path) -> Suite:
    """The suite in a TOML file, or a built-in one by name; raises `SuiteError` that says where it is wrong, and
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
    """Why the optional ones that are not there are not, by the name they use."""
    found = {}
    for name in dict.fromkeys(estimator.use for estimator in estimators if estimator.optional):
        try:
            load(name)
        except NotInstalledError as error:
            found[name] = error
    return found


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
