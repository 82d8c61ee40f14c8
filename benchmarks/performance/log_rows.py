"""Off line: a whole log through the runner of `fusion bench`, more passes over it, and its way out of the file."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.performance.drive import Drive, as_run, drive, site, write_log
from benchmarks.performance.implementation import DEAD_RECKONING, EKF, POSE_EKF, Implementation, Subject
from benchmarks.performance.interleaved import Cost, Job, cpu_s, interleaved
from benchmarks.performance.live_rows import References
from benchmarks.performance.row import AGAIN, DECODE, DRAW, GRID, WHOLE, Row, compared
from benchmarks.runner.estimator_run import run_estimator
from fusion import FusionError
from logs.reader import read_run
from logs.run import Run

CPU_PER_HOUR = "CPU s per hour of log"
HOUR_S = 3600.0
GRID_VALUES = 20
DRAWN = {"gate_probability": 0.9995}
"""The parameter of a further draw: another value than the default."""


def log_rows(subjects: Sequence[Subject], beside: References | None, seconds: float, rounds: int) -> list[Row]:
    """Whole log, further estimator and further draw; the seconds are those of the log."""
    drives = {flag: drive(seconds, site(calibrated=flag)) for flag in (False, True)}
    runs = {flag: as_run(driven) for flag, driven in drives.items()}
    jobs: dict[str, Job] = {one.name: _passes(one, runs[one.calibrated]) for one in subjects}
    for loop in beside or ():
        jobs[loop.name] = _loop(loop, drives[True])
    found = interleaved(jobs, rounds)
    costs = {name: [one.times(HOUR_S / seconds) for one in each] for name, each in found.items()}
    return [*_whole(subjects, beside, costs), *_more(beside, costs)]


def _passes(subject: Subject, run: Run) -> Job:
    """The first pass over a run, and of the ekf two more: after another estimator, and with another parameter."""

    def job() -> tuple[float, ...]:
        first = fold(subject, replace(run))
        if subject not in (EKF, POSE_EKF):
            return (first,)
        shared = replace(run)
        fold(DEAD_RECKONING, shared)
        return first, fold(subject, shared), fold(replace(subject, options=DRAWN), shared)

    return job


def fold(subject: Subject, run: Run) -> float:
    """Processor time of one estimator over a run, with all that `fusion bench` keeps of it [s]."""

    def work() -> None:
        made = run_estimator(run, subject.estimator, subject.options)
        if made.error is not None:
            raise FusionError(f"{subject.name}: {made.error}")
        made.track, made.fates  # noqa: B018 - asking computes them

    return cpu_s(work)


def _loop(loop: Implementation, driven: Drive) -> Job:
    blocks = loop.blocks(driven)

    def work() -> None:
        made = loop.start(driven)
        for steps, scan in blocks:
            made.move(steps)
            made.update(scan)

    return lambda: (cpu_s(work),)


def _whole(
    subjects: Sequence[Subject], beside: References | None, costs: Mapping[str, Sequence[Cost]]
) -> Iterator[Row]:
    for one in subjects:
        reference = None if beside is None else _reference(beside.of(one), costs)
        yield compared(WHOLE, one.name, CPU_PER_HOUR, costs[one.name][0], reference)
    for loop in beside or ():
        yield compared(WHOLE, loop.name, CPU_PER_HOUR, costs[loop.name][0], None)


def _more(beside: References | None, costs: Mapping[str, Sequence[Cost]]) -> Iterator[Row]:
    reference = None if beside is None else _reference(beside.ekf, costs)
    for quantity, place in ((AGAIN, 1), (DRAW, 2)):
        for one in (EKF, POSE_EKF):
            yield compared(quantity, one.name, CPU_PER_HOUR, costs[one.name][place], reference)
    for one in (EKF, POSE_EKF):
        first, _, draw = costs[one.name]
        grid = Cost(*(run + (GRID_VALUES - 1) * more for run, more in zip(first, draw, strict=True)))
        yield Row(GRID, one.name, CPU_PER_HOUR, *grid, grid.least / first.least, "one run")


def _reference(loop: Implementation, costs: Mapping[str, Sequence[Cost]]) -> tuple[str, Cost]:
    return loop.name, costs[loop.name][0]


def decode_rows(seconds: float, rounds: int) -> list[Row]:
    """A log read from its file; the median is that of the rounds, too."""
    run = as_run(drive(seconds, site()))
    with tempfile.TemporaryDirectory(prefix="fusion-perf-") as folder:
        path = Path(folder) / "drive.mcap"
        messages = write_log(run, path)
        jobs: dict[str, Job] = {DECODE: lambda: (cpu_s(lambda: read_run(path)),)}
        ((cost,),) = interleaved(jobs, rounds).values()
    rate = Cost(1e-6 * messages / cost.least, 1e-6 * messages / cost.median)
    return [Row(DECODE, "messages", "M messages per CPU s", *rate)]
