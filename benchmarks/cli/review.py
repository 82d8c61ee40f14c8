"""``fusion review``: a run and its estimators in Rerun, and where to look first."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.review.listing import as_lines
from benchmarks.review.review import PREFIX, SCENE, review
from benchmarks.review.reviewed_run import own_log, remarks
from benchmarks.review.scene import SUFFIX
from benchmarks.review.window import serve_web
from benchmarks.runner.run_source import open_run
from benchmarks.runner.suite_file import load_suite
from fusion import ParameterError
from fusion.cli.arguments import at_least_one, estimator_options, not_negative, since_start
from fusion.cli.options import parse_settings
from fusion.plugins import left_out
from logs.cli.import_ import bag_options, given_options
from logs.importers.rosbag import need_world, read_bag
from logs.run import Run


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion review``."""
    subject_options(parser)
    estimator_options(parser)
    parser.add_argument(
        "--save", type=Path, metavar="OUT", help="write OUT.rrd for the Rerun viewer, or a folder of one file a layer"
    )
    parser.add_argument("--png", type=Path, metavar="OUT.png", help="write a picture; needs no display")
    parser.add_argument("--web", action="store_true", help="show it in a browser on this machine, until interrupted")
    parser.add_argument("--at", type=since_start, metavar="S", help="time cursor, since the start; the end by default")
    parser.add_argument(
        "--worst", type=at_least_one, default=0, metavar="K", help="list the K worst moments of each estimator"
    )
    parser.add_argument(
        "--without", action="append", default=[], metavar="ANCHOR", help="as if it had never been received; repeatable"
    )
    parser.add_argument(
        "--reject",
        action="append",
        type=since_start,
        default=[],
        metavar="S",
        help="as if the radio measurement nearest to that time had been refused; repeatable",
    )
    parser.add_argument("--seed", type=not_negative, default=0, help="of the estimators that draw random numbers")


def run(arguments: argparse.Namespace) -> int:
    """Draw, print the places of the files, list the worst moments."""
    if arguments.web and arguments.save is not None and arguments.save.suffix != SUFFIX:
        # The web viewer forgets the layout when a second file follows the one that brings it.
        raise ParameterError(f"--web shows one file, not a folder of layers; give --save {arguments.save}{SUFFIX}")
    settings, recorded = parse_settings(arguments.set), subject(arguments)
    for remark in (*remarks(recorded), *(left_out() if arguments.estimators is None else ())):
        sys.stderr.write(f"fusion review: {remark}\n")
    with tempfile.TemporaryDirectory(prefix=PREFIX) as folder:
        made = review(
            recorded,
            estimators=None if arguments.estimators is None else arguments.estimators.split(","),
            settings=settings,
            save=arguments.save or (Path(folder, SCENE) if arguments.web else None),
            png=arguments.png,
            at_s=arguments.at,
            worst=arguments.worst,
            without=arguments.without,
            reject_s=arguments.reject,
            seed=arguments.seed,
        )
        for written in ([] if arguments.save is None else made.files) + [arguments.png] * (arguments.png is not None):
            sys.stdout.write(f"{written}\n")
        sys.stdout.writelines(as_lines(made.moments, [*words(arguments)], settings, arguments.seed))
        if arguments.web:
            _serve(made.files, arguments.at)
    return 0


def _serve(files: Sequence[Path], at_s: float | None) -> None:
    """Until the server ends, or the user ends it."""
    with serve_web(files) as served:
        sys.stdout.write(f"{served.address}\n")
        sys.stdout.flush()
        if at_s is not None:
            # The web viewer takes no time from outside.
            sys.stderr.write(f"fusion review: the page opens at the start; move its time cursor to {at_s:g} s\n")
        sys.stderr.write("fusion review: serving that page until interrupted (Ctrl-C)\n")
        try:
            served.process.wait()
        except KeyboardInterrupt:
            return


def subject_options(parser: argparse.ArgumentParser) -> None:
    """The run, and the options of a foreign one."""
    parser.add_argument("run", type=Path, metavar="RUN", help="an MCAP log, a ROS 2 bag, or with --suite a run's id")
    bag_options(parser.add_argument_group("a ROS 2 bag that is no log of ours (docs/import.md)"))
    parser.add_argument("--suite", type=Path, metavar="SUITE", help="RUN is the id of a run of this suite")


def words(arguments: argparse.Namespace) -> Iterator[str]:
    """The run as it was asked for, to be asked for again."""
    yield str(arguments.run)
    if arguments.suite is not None:
        yield from ("--suite", str(arguments.suite))
    if arguments.world is not None:
        yield from ("--world", str(arguments.world))
    for topic in arguments.topic:
        yield from ("--topic", topic)
    if arguments.truth_to_map is not None:
        yield from ("--truth-to-map", *(f"{number:g}" for number in arguments.truth_to_map))


def subject(arguments: argparse.Namespace) -> Run:
    """The run that is asked for: a log of ours, a bag with a world, or a run of a suite.

    Raises `ParameterError`, `LogError`, `SuiteError` or `WorldError`.
    """
    options = given_options(arguments)
    if arguments.suite is not None:
        if options:
            raise ParameterError("--suite determines how its bags are read; leave --world, --topic and the like out")
        suite = load_suite(arguments.suite)
        return open_run(suite.run(str(arguments.run)), suite.folder)
    if options:
        return read_bag(arguments.run, need_world(options.pop("world", None)), **options)
    return own_log(arguments.run)
