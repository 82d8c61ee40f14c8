"""The run that a review is of, and the sentences about it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from benchmarks.runner.adhoc_suite import require_log
from benchmarks.runner.run_source import open_log
from fusion import LogError, Ranges, WifiScan
from logs.reader import holds_run
from logs.run import Run


def own_log(path: Path) -> Run:
    """The run in a log of ours; raises `LogError`, with what a bag needs, for anything else."""
    if path.is_dir() or (path.is_file() and not holds_run(path)):
        raise LogError(f"{path}: is no log of ours; for a ROS 2 bag give --world WORLD.toml, and --topic for its truth")
    require_log(path)
    return open_log(path)


def remarks(run: Run) -> Iterator[str]:
    """Warnings of the run, and a sentence for each kind of data that it lacks."""
    yield from run.warnings
    if run.truth is None:
        yield f"{run.path}: holds no ground truth, so nothing shows how far anyone erred"
    if not any(isinstance(measurement, WifiScan | Ranges) for measurement in run.measurements):
        yield f"{run.path}: holds no signal strengths and no ranges, so nothing corrects the odometry"
