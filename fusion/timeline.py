"""Order and lateness, once for every estimator: whatever order measurements arrive in, the epochs are those of arrival
in order.

The total order is (time, motion before radio, sensor, sequence number). A measurement that arrives late but inside the
horizon is put in its place, and the epochs after it are made again; an older one gets the Fate ``late`` and changes
nothing. The states of the front end are values, so all of this is bookkeeping.
"""

from __future__ import annotations

import bisect
from collections import deque
from operator import attrgetter
from typing import NamedTuple

from fusion.epochs import LONGEST, Epoch, FrontEnd, FrontEndState, Longest
from fusion.errors import MeasurementError
from fusion.fates import refused, unusable
from fusion.motion import Increment
from fusion.values import Decision, Fate, Measurement, Odometry, Radio, Reason, nanoseconds
from fusion.world import World

HORIZON_S = 2.0
"""Largest delay of a measurement that is still put in its place."""
MAX_JUMP_NS = nanoseconds(3600.0)
"""A stamp further ahead than this is believed only when the next one agrees."""

Key = tuple[int, int, str, int]


def order(measurement: Measurement) -> Key:
    """The place of a measurement in the total order of a run."""
    is_radio = isinstance(measurement, Radio)
    return measurement.time_ns, int(is_radio), measurement.sensor, measurement.seq


class Moment(NamedTuple):
    """The run as it stands after one measurement.

    Its own ``epochs``, usually none or one, are the run's from number ``first`` on: an estimator goes back to its state
    after ``first`` epochs and steps through them. ``motion`` is what follows the last of them, up to ``time_ns``. What
    lies before epoch number ``settled`` can no longer change. ``fates`` are those of the screening. ``revised``: a late
    measurement made this moment again.
    """

    measurement: Measurement
    fates: tuple[Fate, ...]
    first: int
    epochs: tuple[Epoch, ...]
    motion: Increment
    time_ns: int
    settled: int
    revised: bool = False


class _Entry(NamedTuple):
    """A measurement in its place: the front end after it, and how many epochs the run has by then."""

    key: Key
    measurement: Measurement
    after: FrontEndState
    epochs: int


class Timeline:
    """The measurements of one run, in order, as epochs. Not thread-safe."""

    def __init__(
        self, world: World, start_ns: int, *, horizon_s: float = HORIZON_S, longest: Longest = LONGEST
    ) -> None:
        self._front_end = FrontEnd(world, longest)
        self._horizon_ns = nanoseconds(horizon_s)
        self._start_ns = start_ns
        self._base_key: Key = (start_ns, -1, "", -1)
        self._base, self._settled = self._front_end.start(start_ns), 0
        self._recent: deque[_Entry] = deque()
        self._suspect_ns: int | None = None

    @property
    def _newest_key(self) -> Key:
        return self._recent[-1].key if self._recent else self._base_key

    @property
    def _newest(self) -> tuple[FrontEndState, int]:
        return (self._recent[-1].after, self._recent[-1].epochs) if self._recent else (self._base, self._settled)

    @property
    def time_ns(self) -> int:
        """The time of the newest measurement, or of the start before the first."""
        return self._newest_key[0]

    def held(self, time_ns: int) -> Increment:
        """The motion since the last epoch up to ``time_ns``, held on the last twist."""
        return self._front_end.held(self._newest[0], time_ns)

    def push(self, measurement: Measurement) -> tuple[Moment, ...]:
        """Take one measurement in: the moment after it, then the moments that it made anew."""
        key = order(measurement)
        refusal = self._refusal(measurement, key)
        if refusal is not None:
            state, epochs = self._newest
            return (Moment(measurement, refusal, epochs, (), state.motion, self.time_ns, self._settled),)
        if key > self._newest_key:
            return (self._append(key, measurement),)
        return self._insert(key, measurement)

    def _refusal(self, measurement: Measurement, key: Key) -> tuple[Fate, ...] | None:
        """The reason why the stamp of a measurement keeps it out, or None."""
        newest_ns = self.time_ns
        jumped = measurement.time_ns - newest_ns > MAX_JUMP_NS
        if jumped and (self._suspect_ns is None or abs(measurement.time_ns - self._suspect_ns) > MAX_JUMP_NS):
            self._suspect_ns = measurement.time_ns
            return unusable(measurement, Reason.BAD_CLOCK)
        self._suspect_ns = None
        over = isinstance(measurement, Odometry) and measurement.time_ns <= self._start_ns
        if over or key <= self._base_key or measurement.time_ns < newest_ns - self._horizon_ns:
            return refused(measurement, Decision.LATE, Reason.TOO_LATE)
        if key <= self._newest_key and any(entry.key == key for entry in self._recent):
            return unusable(measurement, Reason.DUPLICATE)
        return None

    def _append(self, key: Key, measurement: Measurement, *, revised: bool = False) -> Moment:
        before, first = self._newest
        after, epochs, fates = self._front_end.advance(before, measurement)
        self._recent.append(_Entry(key, measurement, after, first + len(epochs)))
        while len(self._recent) > 1 and self._recent[0].key[0] < key[0] - self._horizon_ns:
            self._base_key, _, self._base, self._settled = self._recent.popleft()
        return Moment(measurement, fates, first, epochs, after.motion, key[0], self._settled, revised)

    def _insert(self, key: Key, measurement: Measurement) -> tuple[Moment, ...]:
        """Put a late measurement in its place, and make what follows it anew."""
        before = self._recent.copy(), self._base_key, self._base, self._settled
        place = bisect.bisect_left(self._recent, key, key=attrgetter("key"))
        later = [self._recent.pop() for _ in range(len(self._recent) - place)]
        try:
            own = self._append(key, measurement)
            return (own, *(self._append(entry.key, entry.measurement, revised=True) for entry in reversed(later)))
        except MeasurementError:
            self._recent, self._base_key, self._base, self._settled = before
            raise
