"""A verb: `fusion anchors RUN` lists the anchors of a log and their positions."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from logs.reader import read_run


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion anchors`."""
    parser.add_argument("run", metavar="RUN", type=Path, help="a log")


def run(arguments: argparse.Namespace) -> int:
    """List them. Errors of `fusion.errors` may be raised: the command line prints them and exits with 2."""
    for anchor in read_run(arguments.run).world.anchors:
        sys.stdout.write(f"{anchor.id}: {anchor.x:.2f}, {anchor.y:.2f}, {anchor.z:.2f} m\n")
    return 0
