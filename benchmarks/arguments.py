"""Values that several command lines take."""

from __future__ import annotations

import argparse


def at_least_one(text: str) -> int:
    """A count of runs or processes, from a command line."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} do nothing; give 1 or more")
    return number
