"""`fusion record`: the sensors of a robot into logs, until somebody says stop."""

from __future__ import annotations

import argparse
import dataclasses
import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from sensors.keeper import State
from sensors.recording import Recorded, record
from sensors.robot_file import RobotFile
from sensors.supervisor import Status


@contextmanager
def stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """Ctrl-C and SIGTERM set ``stop`` instead of ending the program, for the length of a ``with`` block."""

    def set_stop(_signal: int, _frame: FrameType | None) -> None:
        stop.set()

    before = {number: signal.signal(number, set_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def status_line(statuses: Sequence[Status]) -> str:
    """How all sensors do, in one line.

    >>> status_line([Status("gyro", State.RUNNING, 99.96, 0.01, 400, 0, 0, ""),
    ...              Status("wifi", State.BACKOFF, None, 4.2, 12, 3, 1, "wlan0 is down")])
    'gyro 100.0 Hz | wifi backoff 4.2 s ago (3 dropped)'
    """
    parts = []
    for status in statuses:
        age = "" if status.age_s is None else f" {status.age_s:.1f} s ago"
        rate = "waiting" if status.rate_hz is None else f"{status.rate_hz:.1f} Hz"
        dropped = f" ({status.dropped} dropped)" if status.dropped else ""
        doing = rate if status.state is State.RUNNING else status.state.value + age
        parts.append(f"{status.name} {doing}{dropped}")
    return " | ".join(parts)


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion record`."""
    parser.add_argument("robot", metavar="ROBOT.toml", type=Path, help="the robot file: docs/record.md")
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, required=True, help="where the logs go")
    parser.add_argument("--duration", metavar="S", type=float, help="stop after so many seconds")
    parser.add_argument("--degraded", action="store_true", help="begin without required sensors that are missing")
    parser.add_argument("--fail-fast", action="store_true", help="stop at the first sensor that is lost")
    parser.add_argument("--min-free", metavar="MB", type=float, help="stop when less than this is free on the disk")
    parser.add_argument("--ring", action="store_true", help="give up the oldest files of this robot instead")
    parser.add_argument("--json", action="store_true", help="tell the end as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Record; 0 when it was stopped, 1 when it ended by itself."""
    robot = _with_policy(RobotFile.load(arguments.robot), arguments)
    stop = threading.Event()
    with stopped_by_signals(stop):
        recorded = record(
            robot,
            arguments.output,
            stop=stop,
            duration_s=arguments.duration,
            degraded=arguments.degraded,
            fail_fast=arguments.fail_fast,
            tell=_teller(),
        )
    sys.stderr.write("\n")
    sys.stdout.write(_json(recorded) if arguments.json else _text(recorded))
    if recorded.trouble:
        sys.stderr.write(f"fusion record: {recorded.trouble}\n")
    return int(bool(recorded.trouble))


def _with_policy(robot: RobotFile, arguments: argparse.Namespace) -> RobotFile:
    """What the command line says wins over the file."""
    given = {"ring": arguments.ring or None, "min_free_mb": arguments.min_free}
    changes = {key: value for key, value in given.items() if value is not None}
    return dataclasses.replace(robot, policy=dataclasses.replace(robot.policy, **changes))


def _teller() -> Callable[[Sequence[Status]], None]:
    """Writes the status line: over itself on a terminal, once a change of state elsewhere."""
    last: list[list[State]] = []

    def tell(statuses: Sequence[Status]) -> None:
        states = [status.state for status in statuses]
        if sys.stderr.isatty():
            sys.stderr.write(f"\r\x1b[K{status_line(statuses)}")
            sys.stderr.flush()
        elif last != [states]:
            last[:] = [states]
            sys.stderr.write(status_line(statuses) + "\n")

    return tell


def _text(recorded: Recorded) -> str:
    rows = [f"{s.name}: {s.messages} messages, {s.dropped} dropped, lost {s.losses} times" for s in recorded.statuses]
    return "\n".join([f"{recorded.duration_s:.1f} s", *rows, *map(str, recorded.paths)]) + "\n"


def _json(recorded: Recorded) -> str:
    about = {
        "paths": [str(path) for path in recorded.paths],
        "duration_s": recorded.duration_s,
        "trouble": recorded.trouble,
        "sensors": [status._asdict() | {"state": status.state.value} for status in recorded.statuses],
    }
    return json.dumps(about, indent=2) + "\n"
