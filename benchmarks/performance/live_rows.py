"""Live: the processor time of a message on a robot, with and without an estimate after it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from benchmarks.performance.drive import drive, site
from benchmarks.performance.filterpy_loops import ekf_loop, particle_loop
from benchmarks.performance.implementation import PARTICLE, Implementation, Subject
from benchmarks.performance.interleaved import Cost, interleaved, live_job
from benchmarks.performance.row import MIXED, PUSH, PUSH_ESTIMATE, SCAN, Row, compared

MICROSECONDS = "µs"
MOST_SECONDS = 20.0
"""Length of the drive for one round: the horizon of late data, 2 s, is filled early on."""


class References(NamedTuple):
    """filterpy's loops over a drive, by whom they are compared with; none where it is not installed."""

    ekf: Implementation
    particles: Implementation

    def of(self, subject: Subject) -> Implementation:
        """The one that a subject is compared with."""
        return self.particles if subject.estimator == PARTICLE.estimator else self.ekf


def references() -> References:
    """Both loops; needs filterpy."""
    return References(ekf_loop(), particle_loop())


def live_rows(subjects: Sequence[Subject], beside: References | None, seconds: float, rounds: int) -> list[Row]:
    """Push, push with estimate, update and both in proportion, of every subject and of what it is compared with."""
    seconds = min(seconds, MOST_SECONDS)
    drives = {flag: drive(seconds, site(calibrated=flag)) for flag in (False, True)}
    jobs = {
        (one.name, flag): live_job(one.live(estimates=flag), drives[one.calibrated])
        for one in subjects
        for flag in (False, True)
    }
    for one in beside or ():
        jobs[one.name, False] = live_job(one, drives[True])
    costs = {key: [one.times(1e6) for one in found] for key, found in interleaved(jobs, rounds).items()}
    return list(_rows(subjects, beside, costs))


def _rows(
    subjects: Sequence[Subject], beside: References | None, costs: Mapping[tuple[str, bool], Sequence[Cost]]
) -> Iterator[Row]:
    for quantity, estimates, place in ((PUSH, False, 0), (PUSH_ESTIMATE, True, 0), (SCAN, False, 1), (MIXED, False, 2)):
        for one in subjects:
            other = None if beside is None else beside.of(one).name
            reference = None if other is None else (other, costs[other, False][place])
            yield compared(quantity, one.name, MICROSECONDS, costs[one.name, estimates][place], reference)
        for loop in beside or ():
            yield compared(quantity, loop.name, MICROSECONDS, costs[loop.name, False][place], None)
