"""``fusion bench score``: score one recorded track against another, without running anything."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import IO

from benchmarks.metrics.alignment import ALIGNMENTS
from benchmarks.metrics.pair import MODES, PairScore, score_pair
from benchmarks.metrics.pair_table import sheets
from benchmarks.output import write_json
from benchmarks.sheet import print_sheets


def print_score(score: PairScore, file: IO[str] | None = None) -> None:
    """As tables for people."""
    print_sheets(sheets(score), file)


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bench score``."""
    track = "a TUM file, a CSV (time_s,x_m,y_m,heading_rad) or an MCAP log"
    parser.add_argument("--truth", required=True, metavar="FILE", help=track)
    parser.add_argument("--estimate", required=True, metavar="FILE", help=f"{track}; run.mcap:ekf chooses a lane of it")
    parser.add_argument("--mode", choices=MODES, default=MODES[0], help="causal, or truth interpolated at the estimate")
    parser.add_argument("--align", choices=("none", *ALIGNMENTS), default="none", help="beside the raw score")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as one record; - for stdout")


def run(arguments: argparse.Namespace) -> int:
    """Score, print the tables, write the record."""
    score = score_pair(arguments.truth, arguments.estimate, mode=arguments.mode, alignment=arguments.align)
    for warning in score.warnings:
        sys.stderr.write(f"fusion bench score: {warning}\n")
    if arguments.json != Path("-"):
        print_score(score)
    if arguments.json is not None:
        write_json(arguments.json, score.record(), indent=1)
    return 0
