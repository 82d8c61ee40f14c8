"""``fusion reproduce``: the paper's experiments run again, its tables beside ours, a verdict on every claim."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import fusion
from benchmarks.paper.experiment import run_experiments
from benchmarks.paper.report import Report
from fusion.output.progress import Progress

TRIALS = 200


def reproduce(
    trials: int = TRIALS,
    *,
    seed: int = 0,
    scenarios: Path | None = None,
    estimators: Sequence[str] | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Run every experiment ``trials`` times, from ``seed`` on; the same report whatever the ``workers``.

    ``scenarios``: a folder of scenario files that `write_calibrated` has made, None for the built-in ones.
    ``estimators``: those that stand beside the paper's curves, None for all of this package. ``workers`` None: one per
    core. Raises `ParameterError`, `PluginError` or `WorldError` before any work.
    """
    for name in estimators or ():
        fusion.load(name)
    outcomes = run_experiments(
        trials,
        seed=seed,
        scenarios=scenarios,
        estimators=estimators,
        workers=os.cpu_count() or 1 if workers is None else workers,
        progress=progress or (lambda *_: None),
    )
    return Report.of(outcomes)
