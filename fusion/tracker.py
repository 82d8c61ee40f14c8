"""One estimator on one stream of measurements, in time order whatever order they arrive in.

Live and replay are the same fold: feed `Tracker.push` as readings come in, or a whole log to `track`. Several
estimators on one stream share a `Timeline`, so that motion is integrated once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from fusion.estimator import Estimator, Particles
from fusion.fold import Fold, Update
from fusion.timeline import HORIZON_S, Key, Timeline, order
from fusion.values import Estimate, Measurement, Prior, Reason
from fusion.world import World


class Tracker:
    """One estimator on one stream. Not thread-safe; give each thread its own."""

    def __init__(
        self, estimator: Estimator[Any], world: World, prior: Prior, *, seed: int = 0, horizon_s: float = HORIZON_S
    ) -> None:
        self._timeline = Timeline(world, prior.time_ns, horizon_s=horizon_s)
        self._fold = Fold(estimator, prior, seed)

    @property
    def time_ns(self) -> int:
        """The time of the newest measurement, or of the prior before the first."""
        return self._timeline.time_ns

    def push(self, measurement: Measurement) -> list[Update]:
        """Take one measurement in; the first update is its own, those after it are revisions it caused."""
        return [self._fold.take(moment) for moment in self._timeline.push(measurement)]

    def estimate(self, time_ns: int) -> Estimate:
        """The belief at ``time_ns``, motion held on the last twist; not before the newest measurement."""
        time_ns = max(time_ns, self.time_ns)
        return self._fold.estimate(self._timeline.held(time_ns), time_ns)

    def particles(self) -> Particles | None:
        """The belief at the last epoch as weighted points; None of an estimator that does not offer them."""
        return self._fold.particles()


def track(
    estimator: Estimator[Any],
    world: World,
    measurements: Iterable[Measurement],
    prior: Prior,
    *,
    seed: int = 0,
    horizon_s: float = HORIZON_S,
) -> Iterator[Update]:
    """Every update of ``estimator`` over ``measurements``, in arrival order."""
    tracker = Tracker(estimator, world, prior, seed=seed, horizon_s=horizon_s)
    for measurement in measurements:
        yield from tracker.push(measurement)


def final(updates: Iterable[Update]) -> list[Update]:
    """The last word on every measurement, in time order: what arrival in order would have given."""
    last: dict[Key, Update] = {}
    for update in updates:
        key = order(update.measurement)
        if update.fates and update.fates[0].reason in (Reason.DUPLICATE, Reason.TOO_LATE) and key in last:
            continue
        last[key] = update
    return [last[key] for key in sorted(last)]
