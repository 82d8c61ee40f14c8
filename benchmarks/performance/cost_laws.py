"""The laws by which cost grows, each measured at several points in turn and fitted by a line."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

import fusion
from benchmarks.performance.drive import STEP_NS, Drive, as_run, drive, site
from benchmarks.performance.implementation import EKF, PARTICLE
from benchmarks.performance.interleaved import Cost, Job, cpu_s, interleaved, live_job
from benchmarks.performance.log_rows import fold
from benchmarks.performance.row import LATE, LENGTH, PARTICLES, RECEIVED, REFOLDS, UNUSED, Row
from fusion import Estimate, Estimator, Fate, Increment, Measurement, Prior, Radio, Ranges, Tag, Tracker

LIVE_S = 6.0
"""Length of the drive at each point: three times the horizon of late data."""


class Law(NamedTuple):
    """A cost at several ``points``, in ``unit``; the least squares line through the least costs has this ``slope``,
    per one more, and this ``intercept``.
    """

    name: str
    subject: str
    unit: str
    points: tuple[float, ...]
    costs: tuple[Cost, ...]

    @property
    def line(self) -> tuple[float, float]:
        """Slope and intercept."""
        slope, intercept = np.polyfit(self.points, [cost.least for cost in self.costs], 1).tolist()
        return slope, intercept

    @property
    def exponent(self) -> float:
        """Slope on logarithmic axes: 1 for a cost in proportion, 0 for one that does not grow."""
        costs = [cost.least for cost in self.costs]
        return float(np.polyfit(np.log(self.points), np.log(costs), 1)[0])

    @property
    def row(self) -> Row:
        """The far end against the near end."""
        first, last = self.costs[0], self.costs[-1]
        subject = f"{self.subject}, {self.points[-1]:g} for {self.points[0]:g}"
        return Row(self.name, subject, self.unit, *last, last.least / first.least, "the first")


def laws(seconds_of_log: float, rounds: int) -> Iterator[Law]:
    """All of them but that of workers."""
    yield _law(LENGTH, "ekf", "CPU s", tuple(seconds_of_log / part for part in (8, 4, 2)), _length_job, rounds)
    yield _law(RECEIVED, "ekf", "µs per scan", (3, 6, 12, 24), _received_job, rounds)
    yield _law(UNUSED, "ekf", "µs per step, with estimates", (3, 30, 100, 300), _unused_job, rounds)
    yield _law(LATE, "ekf", "µs per message", (0, 15, 50, 150), _late_job, rounds)
    yield _law(PARTICLES, "particle", "µs per scan", (250, 500, 1000, 2000), _particle_job, rounds)


def _law(name: str, subject: str, unit: str, points: Sequence[float], job: Callable[[Any], Job], rounds: int) -> Law:
    found = interleaved({point: job(point) for point in points}, rounds)
    scale = 1e6 if unit.startswith("µs") else 1.0
    return Law(name, subject, unit, tuple(points), tuple(found[point][0].times(scale) for point in points))


def _length_job(length_s: float) -> Job:
    run = as_run(drive(length_s, site()))
    return lambda: (fold(EKF, replace(run)),)


def _received_job(count: int) -> Job:
    return _only(live_job(EKF.live(), drive(LIVE_S, site(24), received=count)), 1)


def _unused_job(count: int) -> Job:
    return _only(live_job(EKF.live(estimates=True), drive(LIVE_S, site(count))), 2)


def _particle_job(count: int) -> Job:
    several = replace(PARTICLE, options={"particles": count})
    return _only(live_job(several.live(), drive(LIVE_S, site())), 1)


def _only(job: Job, place: int) -> Job:
    """A job that answers one of the costs of another."""
    return lambda: (tuple(job())[place],)


def _late_job(steps: int) -> Job:
    driven = drive(LIVE_S, site())
    messages = late(driven, steps)

    def job() -> tuple[float]:
        tracker = EKF.tracker(driven)
        return (cpu_s(lambda: [tracker.push(message) for message in messages]) / len(messages),)

    return job


def late(driven: Drive, steps: int) -> list[Measurement]:
    """The measurements of a drive in the order in which they arrive when every scan is late by so many steps."""

    def arrival(one: Measurement) -> tuple[int, bool]:
        is_scan = isinstance(one, Ranges)
        return one.time_ns + is_scan * steps * STEP_NS, is_scan

    return sorted(driven.measurements, key=arrival)


def refold_rows(steps: int = 150) -> list[Row]:
    """Number of steps of the ekf when one scan arrives late, all others in time: once for itself, the rest again."""
    driven = drive(LIVE_S, site())
    counted = CountedSteps(fusion.build(EKF.estimator, driven.world))
    tracker = Tracker(counted, driven.world, driven.prior)
    absent = driven.blocks[len(driven.blocks) // 2].scan
    for one in driven.measurements:
        if one is not absent and one.time_ns <= absent.time_ns + steps * STEP_NS:
            tracker.push(one)
    before = counted.steps
    tracker.push(absent)
    return [Row(REFOLDS, f"{steps} steps late", "steps", counted.steps - before)]


class CountedSteps:
    """An estimator that counts how often it is asked to step."""

    summary: ClassVar[str] = "another estimator, its steps counted"
    tags: ClassVar[frozenset[Tag]] = frozenset()

    def __init__(self, counted: Estimator[Any]) -> None:
        self._counted = counted
        self.steps = 0

    def start(self, prior: Prior, seed: int) -> Any:  # noqa: ANN401 - a state is opaque
        """That of the other."""
        return self._counted.start(prior, seed)

    def step(self, state: Any, motion: Increment, scan: Radio | None) -> tuple[Any, tuple[Fate, ...]]:  # noqa: ANN401
        """That of the other, counted."""
        self.steps += 1
        return self._counted.step(state, motion, scan)

    def estimate(self, state: Any, motion: Increment, time_ns: int) -> Estimate:  # noqa: ANN401
        """That of the other."""
        return self._counted.estimate(state, motion, time_ns)
