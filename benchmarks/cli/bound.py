"""``fusion bound``: what the anchors of a site allow at best, and where one more, or another place, helps most."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import get_args

from benchmarks.limits.floor_picture import draw
from benchmarks.limits.floor_plan import LIMIT_M, plan_site
from benchmarks.limits.floor_tables import tables, write_record
from fusion.cli.arguments import at_least_one
from fusion.output.figures import require_matplotlib
from fusion.output.progress import progress_bar
from fusion.output.tables import print_tables
from fusion.radio import RadioKind


def configure(parser: argparse.ArgumentParser) -> None:
    """The options of ``fusion bound``."""
    parser.add_argument("site", metavar="WORLD", help="a world or scenario file, a log, or a built-in scenario")
    parser.add_argument(
        "--radio", choices=get_args(RadioKind), help="the kind of readings; default: the one in use there"
    )
    parser.add_argument("--scans", type=at_least_one, default=1, metavar="N", help="readings of each anchor in one fix")
    parser.add_argument("--step", type=float, metavar="M", help="size of the floor's cells; by default some thousands")
    parser.add_argument("--limit", type=float, default=LIMIT_M, metavar="M", help="report the share of floor below it")
    parser.add_argument(
        "--offset-std", type=float, default=0.0, metavar="S", help="common offset, dB or m; inf: not known"
    )
    parser.add_argument("--add", action="store_true", help="find the best place for one more anchor")
    parser.add_argument("--move", action="store_true", help="find the best move of one anchor")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write the whole plan, map included; - for stdout")
    parser.add_argument("--png", type=Path, metavar="OUT", help="draw the map (needs the extra `plots`)")


def run(arguments: argparse.Namespace) -> int:
    """Plan, print the tables, write the record and the picture."""
    if arguments.png is not None:
        require_matplotlib()
    with progress_bar("bound") if arguments.add or arguments.move else nullcontext() as progress:
        plan = plan_site(
            arguments.site,
            radio=arguments.radio,
            scans=arguments.scans,
            step_m=arguments.step,
            limit_m=arguments.limit,
            offset_std=arguments.offset_std,
            add=arguments.add,
            move=arguments.move,
            progress=progress,
        )
    for remark in plan.remarks:
        sys.stderr.write(f"fusion bound: {remark}\n")
    if arguments.json != Path("-"):
        print_tables(tables(plan))
    if arguments.json is not None:
        write_record(plan, arguments.json)
    if arguments.png is not None:
        draw(plan, arguments.png)
    return 0
