"""The run that a review is of: a log of ours, anybody's bag with a world to put it in, or a run of a suite.

Each is opened by the code that opens it for `fusion bench RUN`, `fusion import rosbag` and `fusion bench run`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from benchmarks.runner.adhoc_suite import require_log
from benchmarks.runner.run_source import open_log, open_run
from benchmarks.runner.suite import load_suite
from fusion import LogError, ParameterError, Ranges, WifiScan
from logs.cli.import_ import given_options
from logs.importers.rosbag import need_world, read_bag
from logs.reader import holds_run
from logs.run import Run


def subject(arguments: argparse.Namespace) -> Run:
    """The run that is asked for; raises `ParameterError`, `LogError`, `SuiteError` or `WorldError`."""
    options = given_options(arguments)
    if arguments.suite is not None:
        if options:
            raise ParameterError("--suite says already how its bags are read; leave --world, --topic and the like out")
        suite = load_suite(arguments.suite)
        return open_run(suite.run(str(arguments.run)), suite.folder)
    if options:
        return read_bag(arguments.run, need_world(options.pop("world", None)), **options)
    return own_log(arguments.run)


def own_log(path: Path) -> Run:
    """The run in a log of ours; raises `LogError`, which says what a bag needs, for anything else."""
    if path.is_dir() or (path.is_file() and not holds_run(path)):
        raise LogError(f"{path}: is no log of ours; for a ROS 2 bag give --world WORLD.toml, and --topic for its truth")
    require_log(path)
    return open_log(path)


def remarks(run: Run) -> Iterator[str]:
    """What is wrong with the run, or missing, for a reader who sees only what there is."""
    yield from run.warnings
    if run.truth is None:
        yield f"{run.path}: holds no ground truth, so nothing shows how far anyone erred"
    if not any(isinstance(measurement, WifiScan | Ranges) for measurement in run.measurements):
        yield f"{run.path}: holds no signal strengths and no ranges, so nothing corrects the odometry"
