"""Values that several command lines take."""

from __future__ import annotations

import argparse
import math


def at_least_one(text: str) -> int:
    """A count of runs or processes, from a command line."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} do nothing; give 1 or more")
    return number


def since_start(text: str) -> float:
    """A time [s] after a run's start, from a command line."""
    at_s = float(text)
    if not 0.0 <= at_s < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is no time of a run; give seconds since its start")
    return at_s
