"""`fusion live`: the live pose, one line of JSON each."""

from __future__ import annotations

import argparse
import json
import math
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import closing
from pathlib import Path

from fusion import Estimate
from fusion.cli.options import parse_options
from sensors.cli.signals import stopped_by_signals
from sensors.cli.status_line import StatusLine, totals
from sensors.onboard.live import Ended, Now, live
from sensors.onboard.robot_file import RobotFile


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion live`."""
    parser.add_argument("robot", metavar="ROBOT.toml", type=Path, help="the robot file: docs/record.md")
    parser.add_argument("--estimator", required=True, metavar="NAME", help="`fusion estimators` lists them")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="a parameter of the estimator; repeatable"
    )
    parser.add_argument("--seed", type=int, default=0, help="of estimators that draw random numbers")
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, help="record everything there too")
    parser.add_argument(
        "--shadow", action="append", default=[], metavar="NAME", help="another estimator, for the log; repeatable"
    )
    parser.add_argument("--hz", type=float, default=10.0, help="poses a second (default 10)")
    parser.add_argument("--duration", metavar="S", type=float, help="stop after so many seconds")
    parser.add_argument("--degraded", action="store_true", help="begin without required sensors that are missing")
    parser.add_argument("--json", action="store_true", help="write the result as a last line of JSON, not on stderr")


def run(arguments: argparse.Namespace) -> int:
    """Write the pose until stopped; 0 when it was stopped and all went well, 1 when something ended by itself."""
    stop = threading.Event()
    poses = live(
        RobotFile.load(arguments.robot),
        arguments.estimator,
        options=parse_options(arguments.set),
        seed=arguments.seed,
        shadows=arguments.shadow,
        folder=arguments.output,
        hz=arguments.hz,
        stop=stop,
        duration_s=arguments.duration,
        degraded=arguments.degraded,
    )
    with stopped_by_signals(stop), closing(poses):
        ended = _write_poses(poses)
    if arguments.json:
        _write_line({"ended": _ended(ended)})
    else:
        rows = [f"{ended.duration_s:.1f} s", *totals(ended.statuses), *map(str, ended.paths)]
        sys.stderr.write("\n" + "\n".join(rows) + "\n")
    if ended.trouble:
        sys.stderr.write(f"fusion live: {ended.trouble}\n")
    return int(bool(ended.trouble))


def _write_poses(poses: Generator[Now, None, Ended]) -> Ended:
    """Write every pose: for programs on stdout, for people on stderr."""
    line = StatusLine(over_itself=sys.stderr.isatty() and not sys.stdout.isatty())
    while True:
        try:
            now = next(poses)
        except StopIteration as end:
            ended: Ended = end.value
            return ended
        _write_line(record(now))
        for trouble in now.news:
            sys.stderr.write(f"\nfusion live: {trouble}\n")
        line.write(now.statuses, describe(now), now.warning)


def _ended(ended: Ended) -> dict[str, object]:
    plain = {"paths": [str(path) for path in ended.paths], "statuses": [status.record for status in ended.statuses]}
    return ended._asdict() | plain


def _write_line(content: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(content, allow_nan=False) + "\n")
    sys.stdout.flush()


def record(now: Now) -> dict[str, object]:
    """One pose as values that JSON knows: m, rad, s, map frame; None where a number is not to be used."""
    return {
        "time_ns": now.time_ns if now.estimate is None else now.estimate.time_ns,
        **_pose(now.estimate),
        "error": now.error or None,
        "warning": now.warning or None,
        "measurements": now.measurements,
        "age_s": {s.name: None if s.age_s is None else round(s.age_s, 3) for s in now.statuses},
        "state": {s.name: s.state.value for s in now.statuses},
        "fates": {decision.value: count for decision, count in now.fates.items()},
    }


def _pose(estimate: Estimate | None) -> dict[str, object]:
    """The usable part of an estimate. A pose that is no number is not valid, whatever the estimator claims."""
    if estimate is None or not estimate.valid or not _finite(estimate.pose[:2]):
        unused = dict.fromkeys(("x", "y", "heading", "covariance", "ellipse"))
        return {"valid": False, "heading_known": False, "p_lost": _lost(estimate), **unused}
    x, y, heading = estimate.pose
    heading_known = estimate.heading_known and math.isfinite(heading)
    claim = estimate.covariance if estimate.covariance and _finite(estimate.covariance) else None
    return {
        "valid": True,
        "x": x,
        "y": y,
        "heading_known": heading_known,
        "heading": heading if heading_known else None,
        "covariance": claim and claim._asdict(),
        "ellipse": claim and claim.ellipse._asdict(),
        "p_lost": _lost(estimate),
    }


def _lost(estimate: Estimate | None) -> float | None:
    probability = None if estimate is None else estimate.p_lost
    return probability if probability is not None and math.isfinite(probability) else None


def _finite(numbers: Sequence[float]) -> bool:
    return all(map(math.isfinite, numbers))


def describe(now: Now) -> str:
    """The pose in a few words."""
    if now.estimate is None:
        return "no pose: the estimator ended"
    usable = _pose(now.estimate)
    if not usable["valid"]:
        return "no pose yet"
    x, y, heading = now.estimate.pose
    claim = now.estimate.covariance
    spread = f" ± {claim.ellipse.major_std:.2f}" if claim and usable["ellipse"] else ""
    return f"({x:.2f}, {y:.2f}){spread} m, " + (
        f"{math.degrees(heading):.0f}°" if usable["heading_known"] else "heading unknown"
    )
