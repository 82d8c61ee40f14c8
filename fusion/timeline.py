"""Order and lateness, once for every estimator: whatever order measurements arrive in, the epochs are those of arrival
in order.

The total order is (time, motion before radio, sensor, sequence number). A measurement that arrives late but inside the
horizon is put in its place, and the epochs after it are made again; an older one gets the Fate ``late`` and changes
nothing.
"""

from __future__ import annotations

import bisect
from collections import deque

from fusion.epochs import LONGEST, Epoch, FrontEnd, Longest
from fusion.errors import MeasurementError
from fusion.fates import refused, unusable
from fusion.motion import Increment
from fusion.values import Decision, Fate, Measurement, Odometry, Radio, Reason, nanoseconds
from fusion.world import World

HORIZON_S = 2.0
"""Largest delay of a measurement that is still put in its place."""
MAX_JUMP_NS = nanoseconds(3600.0)
"""A stamp further ahead than this is believed only when the next one agrees."""

STRETCH = 63
"""Place of the last measurement of a stretch that no epoch ends: a late one costs no more steps again than that."""

Key = tuple[int, bool, str, int]


def order(measurement: Measurement) -> Key:
    """The place of a measurement in the total order of a run."""
    return measurement.time_ns, isinstance(measurement, Radio), measurement.sensor, measurement.seq


class _Stretch:
    """Measurements in order, and the front end before the first of them: from there on, late ones are put in place.

    ``first``: number of epochs of the run before it.
    """

    __slots__ = ("_last", "_motions", "_replayed", "_running", "before", "first", "measurements")

    def __init__(self, front_end: FrontEnd, first: int) -> None:
        self.before = front_end.copy()
        self.first = first
        self.measurements: list[Measurement] = []
        self._running: FrontEnd | None = front_end
        self._last: Increment | None = None
        self._replayed: FrontEnd | None = None
        self._motions: list[Increment] = []

    def end(self, motion: Increment) -> None:
        """Nothing more comes; ``motion`` is that after the last."""
        self._running, self._last = None, motion

    def motion_after(self, place: int) -> Increment:
        """The motion since the last epoch, after the measurement of that ``place``; -1: before the first."""
        if place == len(self.measurements) - 1:
            return self._running.motion if self._running is not None else self._last  # type: ignore[return-value] # one
        if place < 0:
            return self.before.motion
        # Asked for late, which is seldom: the front end goes over the stretch once more, for all of its measurements.
        self._replayed = self._replayed or self.before.copy()
        while len(self._motions) <= place:
            self._replayed.advance(self.measurements[len(self._motions)])
            self._motions.append(self._replayed.motion)
        return self._motions[place]


class Moment:
    """The run as it stands after one measurement.

    Its own ``epochs``, usually none or one, are the run's from number ``first`` on: an estimator goes back to its state
    after ``first`` epochs and steps through them. What lies before epoch number ``settled`` can no longer change.
    ``fates`` are those of the screening. ``revised``: a late measurement made this moment again.
    """

    __slots__ = (
        "_motion",
        "_place",
        "_stretch",
        "epochs",
        "fates",
        "first",
        "measurement",
        "revised",
        "settled",
        "time_ns",
    )

    def __init__(
        self,
        measurement: Measurement,
        fates: tuple[Fate, ...],
        first: int,
        epochs: tuple[Epoch, ...],
        time_ns: int,
        settled: int,
        revised: bool,
        stretch: _Stretch,
        place: int,
    ) -> None:
        self.measurement = measurement
        self.fates = fates
        self.first = first
        self.epochs = epochs
        self.time_ns = time_ns
        self.settled = settled
        self.revised = revised
        self._stretch = stretch
        self._place = place
        self._motion: Increment | None = None

    def __repr__(self) -> str:
        """All that it holds, its motion among it."""
        shown = ("measurement", "fates", "first", "epochs", "motion", "time_ns", "settled", "revised")
        return f"Moment({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"

    @property
    def motion(self) -> Increment:
        """The motion since the last epoch up to ``time_ns``, computed when first asked for: at once it costs least."""
        if self._motion is None:
            self._motion = self._stretch.motion_after(self._place)
        return self._motion


class Timeline:
    """The measurements of one run, in order, as epochs. Not thread-safe."""

    def __init__(
        self, world: World, start_ns: int, *, horizon_s: float = HORIZON_S, longest: Longest = LONGEST
    ) -> None:
        self._front_end = FrontEnd(world, start_ns, longest)
        self._horizon_ns = nanoseconds(horizon_s)
        self._start_ns = start_ns
        self._base_key: Key = (start_ns, False, "", -1)
        self._newest_key = self._base_key
        self._count = self._settled = 0
        self._stretch = _Stretch(self._front_end, 0)
        self._older: deque[_Stretch] = deque()
        self._suspect_ns: int | None = None

    @property
    def time_ns(self) -> int:
        """The time of the newest measurement, or of the start before the first."""
        return self._newest_key[0]

    def held(self, time_ns: int) -> Increment:
        """The motion since the last epoch up to ``time_ns``, held on the last twist."""
        return self._front_end.held(time_ns)

    def push(self, measurement: Measurement) -> tuple[Moment, ...]:
        """Take one measurement in: the moment after it, then the moments that it made anew."""
        key = order(measurement)
        if key > self._newest_key and self._start_ns < key[0] <= self._newest_key[0] + MAX_JUMP_NS:
            self._suspect_ns = None
            return (self._append(key, measurement),)
        refusal = self._refusal(measurement, key)
        if refusal is not None:
            place = len(self._stretch.measurements) - 1
            now = self._count, (), self.time_ns, self._settled, False, self._stretch, place
            return (Moment(measurement, refusal, *now),)
        if key > self._newest_key:
            return (self._append(key, measurement),)
        return self._insert(key, measurement)

    def _refusal(self, measurement: Measurement, key: Key) -> tuple[Fate, ...] | None:
        """The reason why the stamp of a measurement keeps it out, or None."""
        time_ns, newest_ns = key[0], self._newest_key[0]
        jumped = time_ns - newest_ns > MAX_JUMP_NS
        if jumped and (self._suspect_ns is None or abs(time_ns - self._suspect_ns) > MAX_JUMP_NS):
            self._suspect_ns = time_ns
            return unusable(measurement, Reason.BAD_CLOCK)
        self._suspect_ns = None
        over = time_ns <= self._start_ns and isinstance(measurement, Odometry)
        if over or key <= self._base_key or time_ns < newest_ns - self._horizon_ns:
            return refused(measurement, Decision.LATE, Reason.TOO_LATE)
        if key <= self._newest_key and any(order(m) == key for s in self._stretches for m in s.measurements):
            return unusable(measurement, Reason.DUPLICATE)
        return None

    @property
    def _stretches(self) -> list[_Stretch]:
        return [*self._older, self._stretch]

    def _append(self, key: Key, measurement: Measurement, *, revised: bool = False) -> Moment:
        epochs, fates = self._front_end.advance(measurement)
        stretch, time_ns = self._stretch, key[0]
        stretch.measurements.append(measurement)
        self._newest_key = key
        place, first = len(stretch.measurements) - 1, self._count
        if epochs or place >= STRETCH:
            self._count += len(epochs)
            self._older.append(stretch)
            stretch.end(self._front_end.motion)
            self._stretch = _Stretch(self._front_end, self._count)
            self._settle(time_ns - self._horizon_ns)
        return Moment(measurement, fates, first, epochs, time_ns, self._settled, revised, stretch, place)

    def _settle(self, oldest_ns: int) -> None:
        """Forget the stretches that end before ``oldest_ns``: nothing so late is taken in."""
        while self._older and self._older[0].measurements[-1].time_ns < oldest_ns:
            self._base_key = order(self._older.popleft().measurements[-1])
            self._settled = self._stretches[0].first

    def _insert(self, key: Key, measurement: Measurement) -> tuple[Moment, ...]:
        """Put a late measurement in its place, and make what follows it anew."""
        before = self._older, self._stretch, self._front_end, self._count, self._newest_key
        stretches = self._stretches
        k = next((k for k in reversed(range(len(stretches))) if _begins_before(stretches[k], key)), 0)
        kept = stretches[k]
        later = [m for stretch in stretches[k:] for m in stretch.measurements]
        place = bisect.bisect_left(later, key, key=order)
        self._older, self._front_end, self._count = deque(stretches[:k]), kept.before.copy(), kept.first
        self._stretch = _Stretch(self._front_end, kept.first)
        try:
            for m in later[:place]:
                self._append(order(m), m)
            own = self._append(key, measurement)
            return (own, *(self._append(order(m), m, revised=True) for m in later[place:]))
        except MeasurementError:
            self._older, self._stretch, self._front_end, self._count, self._newest_key = before
            raise


def _begins_before(stretch: _Stretch, key: Key) -> bool:
    return bool(stretch.measurements) and order(stretch.measurements[0]) < key
