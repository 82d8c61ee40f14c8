"""A suite: which runs, which estimators with which parameters, which faults, how often, and what counts as passing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

from benchmarks.metrics.matching import MAX_AGE_S
from fusion import SuiteError
from fusion.errors import did_you_mean
from logs.truth import GAP_S, RATE_HZ

CATALOGUE = "catalogue"
"""The file beside the built-in suites that lists the sources of recordings."""
CLEAN = "clean"
"""The fault that is none; every suite has it."""
TUNE, TEST = "tune", "test"
"""Purpose of a run: parameters are chosen on the first kind and judged on the second."""
READINGS = ("causal", "interp")
"""Ways to match truth and estimate."""
INCONCLUSIVE = ("fail", "warn")
"""Ways for a gate to treat an inconclusive finding."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Rules by which estimates are judged: `benchmarks.metrics.matching`."""

    hz: float = RATE_HZ
    reading: str = "causal"
    max_age_s: float = MAX_AGE_S
    gap_s: float = GAP_S


@dataclass(frozen=True, slots=True)
class CellLimits:
    """Limits of one cell: wall-clock time [s] and resident memory [MB]."""

    wall_s: float = 600.0
    rss_mb: float = 4096.0


@dataclass(frozen=True, slots=True)
class RunSource:
    """Source of a run: a log of ours, a foreign bag with its ``world``, or a simulated ``scenario``."""

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
    """Source of a log that is not there: a set of `benchmarks/suites/catalogue.toml`."""


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
        combinations = []
        for values in product(*self.grid.values()):
            chosen = dict(zip(self.grid, values, strict=True))
            suffix = ",".join(f"{key}={value}" for key, value in chosen.items())
            combinations.append(replace(self, id=f"{self.id}[{suffix}]", params={**self.params, **chosen}))
        return combinations


@dataclass(frozen=True, slots=True)
class FaultSet:
    """Faults applied together, as tables of `benchmarks.faults.inject`."""

    id: str
    apply: Sequence[Mapping[str, object]] = ()


@dataclass(frozen=True, slots=True)
class Gate:
    """Conditions of `bench gate`. ``ratio``: by how much a metric may grow over the baseline; ``floor``: its least
    value; ``inside``: metrics that must lie in their chi-square band; ``inconclusive``: how such findings count.
    """

    baseline: str | None = None
    ratio: Mapping[str, float] = field(default_factory=dict)
    floor: Mapping[str, float] = field(default_factory=dict)
    inside: tuple[str, ...] = ()
    inconclusive: str = "fail"


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
        """Folder of its relative paths: its file's; the present one for a suite of the package."""
        return Path.cwd() if self._is_builtin else self.path.parent

    @property
    def word(self) -> str:
        """Its name on a command line, wherever that is typed on this machine."""
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
