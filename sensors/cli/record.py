"""`fusion record`: the sensors of a robot into logs, until stopped."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import threading
from pathlib import Path

from sensors.cli.signals import stopped_by_signals
from sensors.cli.status_line import StatusLine, totals
from sensors.onboard.recorder import Recorded, record
from sensors.onboard.robot_file import RobotFile


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion record`."""
    parser.add_argument("robot", metavar="ROBOT.toml", type=Path, help="the robot file: docs/record.md")
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, required=True, help="where the logs go")
    parser.add_argument("--duration", metavar="S", type=float, help="stop after so many seconds")
    parser.add_argument("--degraded", action="store_true", help="begin without required sensors that are missing")
    parser.add_argument("--fail-fast", action="store_true", help="stop at the first sensor that is lost")
    parser.add_argument("--min-free", metavar="MB", type=float, help="stop when less than this is free on the disk")
    parser.add_argument("--ring", action="store_true", help="give up the oldest files of this robot instead")
    parser.add_argument("--json", action="store_true", help="write the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Record; 0 when it was stopped, 1 when it ended by itself."""
    robot = _with_policy(RobotFile.load(arguments.robot), arguments)
    stop, line = threading.Event(), StatusLine()
    with stopped_by_signals(stop):
        recorded = record(
            robot,
            arguments.output,
            stop=stop,
            duration_s=arguments.duration,
            degraded=arguments.degraded,
            fail_fast=arguments.fail_fast,
            on_status=lambda statuses, warning: line.write(statuses, warning=warning),
        )
    sys.stderr.write("\n")
    sys.stdout.write(_json(recorded) if arguments.json else _text(recorded))
    if recorded.warning:
        sys.stderr.write(f"warning: {recorded.warning}\n")
    if recorded.trouble:
        sys.stderr.write(f"fusion record: {recorded.trouble}\n")
    return int(bool(recorded.trouble))


def _with_policy(robot: RobotFile, arguments: argparse.Namespace) -> RobotFile:
    """The policy of the file, overridden by the command line."""
    given = {"ring": arguments.ring or None, "min_free_mb": arguments.min_free}
    changes = {key: value for key, value in given.items() if value is not None}
    return dataclasses.replace(robot, policy=dataclasses.replace(robot.policy, **changes))


def _text(recorded: Recorded) -> str:
    return "\n".join([f"{recorded.duration_s:.1f} s", *totals(recorded.statuses), *map(str, recorded.paths)]) + "\n"


def _json(recorded: Recorded) -> str:
    about = {
        "paths": [str(path) for path in recorded.paths],
        "duration_s": recorded.duration_s,
        "trouble": recorded.trouble,
        "warning": recorded.warning,
        "sensors": [status.record for status in recorded.statuses],
    }
    return json.dumps(about, indent=2) + "\n"
