"""The host: folds measurements through one estimator, in time order whatever order they arrive in.

It owns what no estimator should have to know: screening, order, lateness, odometry, clocks. The total order is
(time, motion before radio, sensor, sequence number). A measurement that arrives late but inside the horizon is put in
its place and everything after it is folded again from the kept state, so the result is that of arrival in order, to
the bit. An older one gets the Fate ``late`` and changes nothing. States are values, so all of this is bookkeeping.

Live and replay are the same fold: feed `Tracker.push` as readings come in, or a whole log to `track`.
"""

from __future__ import annotations

import bisect
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from fusion.errors import PluginError
from fusion.estimator import Estimator, ParticleEstimator, Particles
from fusion.odometry import Odometer, OdometerState
from fusion.screen import refused, screen, unusable
from fusion.values import Decision, Estimate, Fate, Measurement, Odometry, Prior, Ranges, Reason, WifiScan, nanoseconds
from fusion.world import World

HORIZON_S = 2.0
"""How late a measurement may be and still be put in its place."""
MAX_JUMP_NS = nanoseconds(3600.0)
"""A stamp further ahead than this is believed only when the next one agrees."""

Key = tuple[int, int, str, int]


def order(measurement: Measurement) -> Key:
    """The place of a measurement in the total order of a run."""
    is_radio = isinstance(measurement, WifiScan | Ranges)
    return measurement.time_ns, int(is_radio), measurement.sensor, measurement.seq


class Update(NamedTuple):
    """What one measurement led to. ``revised``: it was folded before, and a late one changed its result."""

    measurement: Measurement
    estimate: Estimate
    fates: tuple[Fate, ...]
    revised: bool = False


class _Moment(NamedTuple):
    """Both states at one time; everything the fold needs to go on from there."""

    odometer: OdometerState
    belief: Any


@dataclass(slots=True)
class _Entry:
    key: Key
    measurement: Measurement
    after: _Moment


class Tracker:
    """One estimator on one stream. Not thread-safe; give each thread its own."""

    def __init__(
        self, estimator: Estimator[Any], world: World, prior: Prior, *, seed: int = 0, horizon_s: float = HORIZON_S
    ) -> None:
        self._estimator = estimator
        self._world = world
        self._odometer = Odometer(world.robot)
        self._horizon_ns = nanoseconds(horizon_s)
        self._start_ns = prior.time_ns
        self._base_key: Key = (prior.time_ns, -1, "", -1)
        self._base = _Moment(self._odometer.start(prior.time_ns), estimator.start(prior, seed))
        self._recent: deque[_Entry] = deque()
        self._suspect_ns: int | None = None

    @property
    def _newest(self) -> tuple[Key, _Moment]:
        if self._recent:
            return self._recent[-1].key, self._recent[-1].after
        return self._base_key, self._base

    @property
    def time_ns(self) -> int:
        """The time of the newest measurement, or of the prior before the first."""
        return self._newest[0][0]

    def estimate(self, time_ns: int) -> Estimate:
        """The belief at ``time_ns``, motion held on the last twist; not before the newest measurement."""
        (newest_ns, *_), moment = self._newest
        time_ns = max(time_ns, newest_ns)
        _, motion = self._odometer.hold(moment.odometer, time_ns)
        belief = moment.belief
        for odometry in motion:
            belief, _ = self._estimator.step(belief, odometry)
        return self._estimator.estimate(belief, time_ns)

    def particles(self) -> Particles | None:
        """The belief after the newest measurement as weighted points; None of an estimator that does not offer them."""
        if not isinstance(self._estimator, ParticleEstimator):
            return None
        return self._estimator.particles(self._newest[1].belief)

    def push(self, measurement: Measurement) -> list[Update]:
        """Take one measurement in; the first update is its own, those after it are revisions it caused."""
        key = order(measurement)
        refusal = self._refusal(measurement, key)
        if refusal is not None:
            return [Update(measurement, self.estimate(self._newest[0][0]), refusal)]
        if key > self._newest[0]:
            return [self._append(key, measurement)]
        return self._insert(key, measurement)

    def _refusal(self, measurement: Measurement, key: Key) -> tuple[Fate, ...] | None:
        """Why the stamp of a measurement keeps it out, or None."""
        newest_ns = self._newest[0][0]
        jumped = measurement.time_ns - newest_ns > MAX_JUMP_NS
        if jumped and (self._suspect_ns is None or abs(measurement.time_ns - self._suspect_ns) > MAX_JUMP_NS):
            self._suspect_ns = measurement.time_ns
            return unusable(measurement, Reason.BAD_CLOCK)
        self._suspect_ns = None
        over = isinstance(measurement, Odometry) and measurement.time_ns <= self._start_ns
        if over or key <= self._base_key or measurement.time_ns < newest_ns - self._horizon_ns:
            return refused(measurement, Decision.LATE, Reason.TOO_LATE)
        if key <= self._newest[0] and any(entry.key == key for entry in self._recent):
            return unusable(measurement, Reason.DUPLICATE)
        return None

    def _append(self, key: Key, measurement: Measurement) -> Update:
        moment, fates = self._fold(self._newest[1], measurement)
        self._recent.append(_Entry(key, measurement, moment))
        while len(self._recent) > 1 and self._recent[0].key[0] < key[0] - self._horizon_ns:
            oldest = self._recent.popleft()
            self._base_key, self._base = oldest.key, oldest.after
        return Update(measurement, self._estimator.estimate(moment.belief, key[0]), fates)

    def _insert(self, key: Key, measurement: Measurement) -> list[Update]:
        """Put a late measurement in its place and fold the later ones again."""
        place = bisect.bisect_left([entry.key for entry in self._recent], key)
        later = [self._recent.pop() for _ in range(len(self._recent) - place)]
        own = self._append(key, measurement)
        return [own, *(self._append(e.key, e.measurement)._replace(revised=True) for e in reversed(later))]

    def _fold(self, moment: _Moment, measurement: Measurement) -> tuple[_Moment, tuple[Fate, ...]]:
        kept, fates = screen(self._world, measurement)
        if kept is None:
            return moment, fates
        odometer, seen = self._odometer.advance(moment.odometer, kept)
        belief = moment.belief
        for item in seen:
            try:
                belief, more = self._estimator.step(belief, item)
            except Exception as error:
                name = type(self._estimator).__name__
                raise PluginError(
                    f"{name} failed on {type(item).__name__} of {item.sensor!r} at {item.time_ns} ns: {error!r}; "
                    "leave it out with --estimators, or report it to its author"
                ) from error
            fates += more
        return _Moment(odometer, belief), fates


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
