"""Values that several command lines take."""

from __future__ import annotations

import argparse
import math


def at_least_one(text: str) -> int:
    """A count of runs or processes, from a command line."""
    if not text.lstrip("+-").isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is no such count; give a whole number from 1 on")
    return int(text)


def not_negative(text: str) -> int:
    """A seed, from a command line."""
    if not text.removeprefix("+").isdigit():
        raise argparse.ArgumentTypeError(f"{text} is no seed; give a whole number from 0 on")
    return int(text)


def estimator_options(parser: argparse.ArgumentParser) -> None:
    """Options of a verb that takes several estimators, for `fusion.cli.options.parse_settings`."""
    parser.add_argument("--estimators", metavar="A,B", help="names, separated by commas; all installed by default")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME.KEY=VALUE", help="a parameter of an estimator; repeatable"
    )


def since_start(text: str) -> float:
    """A time [s] after a run's start, from a command line."""
    try:
        at_s = float(text)
    except ValueError:
        at_s = math.nan
    if not 0.0 <= at_s < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is no time of a run; give seconds since its start")
    return at_s
