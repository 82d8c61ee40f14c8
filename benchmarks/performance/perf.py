"""All that `fusion perf` measures, in order: answers first, then speed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.performance.agreement import Answer, beliefs, require_agreement, rmse_m
from benchmarks.performance.cost_laws import Law, laws, refold_rows
from benchmarks.performance.counts import count_rows
from benchmarks.performance.drive import drive, site
from benchmarks.performance.filterpy_loops import missing_filterpy
from benchmarks.performance.implementation import (
    DEAD_RECKONING,
    DYNAMIC_WEIGHT,
    EKF,
    OF_FILTERPY,
    PARTICLE,
    POSE_EKF,
    Subject,
)
from benchmarks.performance.live_rows import References, live_rows, references
from benchmarks.performance.log_rows import decode_rows, log_rows
from benchmarks.performance.processes import start_rows, worker_rows
from benchmarks.performance.row import Row
from benchmarks.runner.timing import machine
from fusion.output.progress import Progress

MOST_CHECKED_S = 60.0
"""Length of the drive on which answers are compared, at most."""
MOST_IN_CELL_S = 60.0
"""Length of each log of the suite that is carried out on one worker and on two, at most."""
STAGES = 5
PACKAGES = ("fusion-localization", "scipy", "mcap", "filterpy")


class Performance(NamedTuple):
    """Figures, and the machine they are of; ``missing`` is a sentence where there is nothing to compare with."""

    conditions: dict[str, str]
    answers: tuple[Answer, ...]
    rows: tuple[Row, ...]
    laws: tuple[Law, ...]
    missing: str | None

    def record(self) -> dict[str, Any]:
        """All numbers, for JSON."""
        return {
            "conditions": self.conditions,
            "missing": self.missing,
            "answers": [answer._asdict() for answer in self.answers],
            "rows": [{**row._asdict(), "floor": _floor(row), "holds": row.holds} for row in self.rows],
            "laws": [_law(law) for law in self.laws],
        }


def _floor(row: Row) -> dict[str, Any] | None:
    if row.floor is None:
        return None
    of = "value" if row.floor.of_value else "ratio"
    return {"sense": row.floor.sense.name.lower(), "bound": row.floor.bound, "of": of}


def _law(law: Law) -> dict[str, Any]:
    slope, intercept = law.line
    costs = [cost._asdict() for cost in law.costs]
    return {**law._asdict(), "costs": costs, "slope": slope, "intercept": intercept}


def measure(minutes: float, rounds: int, progress: Progress | None = None) -> Performance:
    """Everything, on a log of so many ``minutes``, in so many ``rounds``.

    Raises `FusionError` where our filter of the pose alone and filterpy's do not agree: their speeds mean nothing then.
    """
    seconds, missing = 60.0 * minutes, missing_filterpy()
    beside = None if missing else references()
    subjects = (EKF, POSE_EKF, DYNAMIC_WEIGHT, DEAD_RECKONING, PARTICLE, *(() if missing else OF_FILTERPY))
    report = progress or (lambda *_: None)
    report(0, STAGES, "answers")
    compared = answers(subjects, beside, min(seconds, MOST_CHECKED_S))
    report(1, STAGES, "live")
    rows = [*live_rows(subjects, beside, seconds, rounds), *count_rows()]
    report(2, STAGES, "whole log")
    rows += [*log_rows(subjects, beside, seconds, rounds), *decode_rows(seconds, rounds)]
    report(3, STAGES, "cost laws")
    found = tuple(laws(seconds, rounds))
    rows += [*(law.row for law in found), *refold_rows()]
    report(4, STAGES, "processes")
    rows += [*worker_rows(min(seconds, MOST_IN_CELL_S), rounds), *start_rows(rounds)]
    return Performance(conditions(minutes, rounds), compared, tuple(rows), found, missing)


def answers(subjects: Sequence[Subject], beside: References | None, seconds: float) -> tuple[Answer, ...]:
    """The answers of every subject; of the one that can, held against filterpy's."""
    drives = {flag: drive(seconds, site(calibrated=flag)) for flag in (False, True)}
    found = []
    for one in subjects:
        driven = drives[one.calibrated]
        if beside is not None and one is POSE_EKF:
            found.append(require_agreement(one.live(), beside.ekf, driven))
        else:
            found.append(Answer(one.name, rmse_m(beliefs(one.live(), driven), driven)))
    if beside is not None:
        found.append(Answer(beside.particles.name, rmse_m(beliefs(beside.particles, drives[True]), drives[True])))
    return tuple(found)


def conditions(minutes: float, rounds: int) -> dict[str, str]:
    """Conditions of the figures: the log, the machine, the versions, the day."""
    about = {"log": f"{minutes:g} minutes", "rounds": str(rounds), "date": time.strftime("%Y-%m-%d")}
    versions = {name: installed for name in PACKAGES if (installed := _version(name)) is not None}
    return {**about, **machine(), **_processor(), **versions}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> dict[str, str]:
    """The model of the processor, where Linux states it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return {}
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {"processor": models[0]} if models else {}
