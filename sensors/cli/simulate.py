"""``fusion simulate``: drive a simulated robot and record it as an MCAP log."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sensors.simulation.scenario import builtin_names
from sensors.simulation.simulate import simulate


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion simulate`."""
    names = ", ".join(builtin_names())
    parser.add_argument("scenario", metavar="SCENARIO", help=f"one of {names}, or a scenario file (*.toml)")
    parser.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help="the log to write (*.mcap)")
    parser.add_argument("--seed", type=int, default=0, help="another seed, another run (default 0)")
    parser.add_argument("--duration", metavar="S", type=float, help="stop after this many seconds")


def run(arguments: argparse.Namespace) -> int:
    """Simulate and name the log."""
    path = simulate(arguments.scenario, arguments.output, seed=arguments.seed, duration_s=arguments.duration)
    sys.stdout.write(f"{path}\n")
    return 0
