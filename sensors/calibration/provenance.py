"""The runs that a calibration is made from, and their record in the calibrated world."""

from __future__ import annotations

import dataclasses
import datetime
import hashlib
from collections.abc import Sequence
from pathlib import Path

import fusion
from fusion import LogError, World
from fusion.values import NANOSECONDS
from fusion.world import Calibration
from logs.reader import read_run
from logs.run import Run

FIRST_DATE_S = 946_684_800
"""Stamps before the year 2000 count from an unknown start, not from 1970."""


def load_runs(paths: Sequence[Path], world: Path | None = None) -> list[Run]:
    """Runs with one robot among the same anchors, or with ``world`` in place of their own; raises `LogError` else."""
    for path in paths:
        if not path.is_file():
            raise LogError(f"{path}: no such file; give an MCAP log (`fusion simulate` makes one)")
    runs = [read_run(path) for path in paths]
    if world is not None:
        other = World.load(world)
        return [dataclasses.replace(run, world=other) for run in runs]
    for run in runs[1:]:
        if (run.world.anchors, run.world.robot) != (runs[0].world.anchors, runs[0].world.robot):
            raise LogError(
                f"{runs[0].path} and {run.path} have other anchors or another robot in their worlds; "
                "calibrate them one by one, or give --world FILE for both"
            )
    return runs


def recorded(runs: Sequence[Run]) -> str:
    """The date (UTC) of the newest measurement by the logs' own stamps; "unknown" where their clock has none."""
    newest_s = max(measurement.time_ns for run in runs for measurement in run.measurements) // NANOSECONDS
    if newest_s < FIRST_DATE_S:
        return "unknown"
    return datetime.datetime.fromtimestamp(newest_s, datetime.UTC).date().isoformat()


def provenance(runs: Sequence[Run], method: str, samples: int, residual_std: float) -> Calibration:
    """Provenance of the numbers; the same runs give the same record."""
    return Calibration(
        method=method,
        logs=tuple(run.path.name for run in runs),
        sha256=tuple(hashlib.sha256(run.path.read_bytes()).hexdigest() for run in runs),
        recorded=recorded(runs),
        samples=samples,
        residual_std=significant(residual_std),
        fusion=fusion.__version__,
    )


def significant(value: float) -> float:
    """Six digits: more than any calibration knows."""
    return float(f"{value:.6g}")
