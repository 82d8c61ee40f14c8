"""One estimator over one run: all its updates, its processor time, and why it ended if it did not survive."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TypeAlias

import fusion
from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.fates import FateColumns
from fusion import Fold, FusionError, Moment, Timeline, Update
from fusion.timeline import Key
from logs.prior import starting_prior
from logs.run import Run

Watch: TypeAlias = Callable[[Fold, Moment], None]
"""Called after every moment of the run; it may look, and must not touch."""


@dataclass(frozen=True)
class EstimatorRun:
    """One estimator over one run.

    ``updates`` stand in the order of arrival, revisions among them; ``digest`` certifies them. ``cpu_s`` is the
    processor time of the fold alone. ``error`` is None, or why the estimator stopped: ``updates`` ends there then,
    ``digest`` is empty and ``cpu_s`` zero. ``true_stamps``: those of the run.
    """

    name: str
    updates: tuple[Update, ...] = ()
    digest: str = ""
    cpu_s: float = 0.0
    error: str | None = None
    true_stamps: Mapping[Key, int] = field(default_factory=dict)

    @cached_property
    def final(self) -> tuple[Update, ...]:
        """The final update of each measurement, in time order."""
        return tuple(fusion.final(self.updates))

    @cached_property
    def track(self) -> Track:
        """All updates as columns; of an estimator that crashed none, for half a run is not a result."""
        return Track.of(() if self.error else self.updates, self.true_stamps)

    @cached_property
    def fates(self) -> FateColumns:
        """The final fate of every reading, as columns."""
        return FateColumns.of(self.final)


@lru_cache(maxsize=2)
def run_moments(run: Run) -> tuple[Moment, ...]:
    """The run as the host sees it, moment by moment: screened, in order, motion integrated once for every estimator."""
    timeline, moments = Timeline(run.world, starting_prior(run).time_ns), list[Moment]()
    for measurement in run.measurements:
        for moment in timeline.push(measurement):
            moment.motion  # noqa: B018 - asked for later, it would be integrated once more
            moments.append(moment)
    return tuple(moments)


def run_estimator(
    run: Run, estimator: str, options: Mapping[str, object] | None = None, seed: int = 0, *, watch: Watch | None = None
) -> EstimatorRun:
    """Fold the measurements of ``run`` through the estimator of that name. Never raises for what a plug-in does."""
    updates: list[Update] = []
    certificate, error, cpu_s = "", None, 0.0
    try:
        built, prior = fusion.build(estimator, run.world, options), starting_prior(run)
        moments = run_moments(run)
        started_s = time.process_time()
        fold = Fold(built, prior, seed)
        for moment in moments:
            update = fold.take(moment)
            update.estimate  # noqa: B018 - computed now, so that the state behind it can go
            updates.append(update)
            if watch is not None:
                watch(fold, moment)
        cpu_s = time.process_time() - started_s
        # Reads every number there is, so an answer that is no number ends here and not in the scores.
        certificate = fusion.digest(updates)
    except FusionError as known:
        error = str(known)
    except Exception as unknown:  # noqa: BLE001 - a plug-in may fail in any way, and costs only its own run
        error = f"{estimator} failed: {unknown!r}; leave it out with --estimators"
    return EstimatorRun(estimator, tuple(updates), certificate, cpu_s, error, true_stamps=run.true_stamps)
