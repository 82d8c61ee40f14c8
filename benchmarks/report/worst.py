"""The moment at which each cell erred most, and the command that shows it in Rerun."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence

import numpy as np

from benchmarks.runner.results import Result, judged
from benchmarks.runner.review_command import review_command
from benchmarks.runner.suite import CLEAN


def command(result: Result, suite: Sequence[str]) -> str:
    """Command that makes the cell again and shows its worst moment; ``suite``: the words that name the suite and its
    store on a command line.
    """
    cell = result.cell
    log = re.sub(r"[^\w.=-]+", "-", f"{cell.run.id}.{cell.estimator.id}.{cell.fault.id}.{cell.seed}") + ".mcap"
    words = ["fusion", "bench", "replay", *suite, cell.run.id, cell.estimator.id]
    words += [] if cell.fault.id == CLEAN else ["--fault", cell.fault.id]
    words += ["--seed", str(cell.seed)] if cell.seed else []
    made = shlex.join([*words, "-o", log])
    use, params = cell.estimator.use, cell.estimator.params
    return f"{made} && {review_command([log], use, result.worst_at_s, params=params, seed=cell.seed)}"


def worst_moments(results: Sequence[Result], count: int = 10) -> list[Result]:
    """The cells without faults that hold the ``count`` worst, of the runs that count; of several seeds the worst."""
    clean = [one for one in judged(results) if one.cell.fault.id == CLEAN and one.worst_at_s is not None]
    worst: dict[tuple[str, str], Result] = {}
    for one in sorted(clean, key=lambda one: -one.metrics.get("pos_max", np.nan)):
        worst.setdefault((one.cell.run.id, one.cell.estimator.id), one)
    return list(worst.values())[:count]
