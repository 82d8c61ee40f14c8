"""`fusion info`: what is in a log, and whether anything is wrong with it."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Any

from fusion.values import seconds
from logs.bag import open_bag
from logs.reader import holds_run, read_run
from logs.roles import roles_of
from logs.run import Run


def describe(path: Path) -> dict[str, Any]:
    """Everything `fusion info` tells, as plain values: times in seconds, rates in hertz.

    A bag of somebody else's is told topic by topic, under the key ``topics``.
    """
    if path.is_dir() or not holds_run(path):
        return _describe_bag(path)
    run = read_run(path)
    return {
        "path": str(path),
        "name": run.name,
        "world": run.world.name,
        "world_hash": run.world.hash,
        "anchors": [anchor.id for anchor in run.world.anchors],
        "duration_s": _duration_s(run),
        "channels": _channels(run),
        "truth": 0 if run.truth is None else len(run.truth),
        "prior": None if run.prior is None else [*run.prior.pose],
        "position_known": run.prior is not None and run.prior.position_known,
        "heading_known": run.prior is not None and run.prior.heading_known,
        "estimators": {name: len(estimates) for name, estimates in run.lanes.items()},
        "metadata": dict(run.metadata),
        "warnings": list(run.warnings),
    }


def _describe_bag(path: Path) -> dict[str, Any]:
    bag = open_bag(path, keep=lambda _kind, _sample: False)
    heard = [topic for topic in bag.topics.values() if topic.count]
    first_ns = min((topic.first_ns for topic in heard), default=0)
    last_ns = max((topic.last_ns for topic in heard), default=0)
    return {
        "path": str(path),
        "name": path.resolve().name.removesuffix(".mcap"),
        "duration_s": seconds(last_ns - first_ns),
        "topics": [
            {
                "topic": topic.name,
                "type": topic.type,
                "encoding": topic.encoding,
                "count": topic.count,
                "rate_hz": topic.rate_hz,
                "undecodable": topic.unreadable,
                "roles": roles_of(topic),
                "names": sorted(topic.names),
                "missing": topic.missing,
            }
            for topic in bag.topics.values()
        ],
        "warnings": bag.warnings,
    }


def _duration_s(run: Run) -> float:
    times = [measurement.time_ns for measurement in run.measurements]
    return seconds(max(times) - min(times)) if times else 0.0


def _channels(run: Run) -> list[dict[str, Any]]:
    """One row per sensor: how much, how often, the longest gap, and stamps that ran backwards."""
    by_sensor: dict[tuple[str, str], list[int]] = defaultdict(list)
    for measurement in run.measurements:
        by_sensor[type(measurement).__name__, measurement.sensor].append(measurement.time_ns)
    rows = []
    for (kind, sensor), times in sorted(by_sensor.items()):
        span_s = seconds(max(times) - min(times))
        gaps = [later - earlier for earlier, later in pairwise(sorted(times))]
        rows.append(
            {
                "kind": kind,
                "sensor": sensor,
                "count": len(times),
                "rate_hz": (len(times) - 1) / span_s if span_s > 0.0 else None,
                "longest_gap_s": seconds(max(gaps, default=0)),
                "out_of_order": sum(later < earlier for earlier, later in pairwise(times)),
            }
        )
    return rows


def _rate(rate_hz: float | None) -> str:
    return "once" if rate_hz is None else f"{rate_hz:.2f} Hz"


def _bag_text(about: dict[str, Any]) -> str:
    """A foreign bag for a reader: a line per topic, and what it could be."""
    lines = [f"{about['name']}: a bag of {about['duration_s']:.1f} s, not a log of fusion"]
    width = max((len(row["topic"]) for row in about["topics"]), default=0)
    for row in about["topics"]:
        could = f"  could be {' or '.join(row['roles'])}" if row["roles"] else ""
        names = f" ({', '.join(row['names'])})" if row["names"] else ""
        bad = f", {row['undecodable']} cannot be decoded" if row["undecodable"] else ""
        rate = _rate(row["rate_hz"]) if row["count"] else "empty"
        lines.append(f"  {row['topic']:<{width}} {row['count']:>7}  {rate:>10}  {row['type']}{bad}{could}{names}")
        lines += [f"    {row['missing']}"] if row["missing"] else []
    lines.append("bring it in: fusion import rosbag BAG --world WORLD.toml --topic ROLE=TOPIC ... -o OUT.mcap")
    lines += [f"warning: {warning}" for warning in about["warnings"]]
    return "\n".join(lines) + "\n"


def _text(about: dict[str, Any]) -> str:
    """The same for a reader."""
    if "topics" in about:
        return _bag_text(about)
    lines = [
        f"{about['name']}: {about['duration_s']:.1f} s in the world {about['world']!r} ({about['world_hash'][:12]})"
    ]
    lines.append(f"anchors: {', '.join(about['anchors']) or 'none'}")
    for row in about["channels"]:
        rate = _rate(row["rate_hz"])
        late = f", {row['out_of_order']} out of order" if row["out_of_order"] else ""
        gap = f"longest gap {row['longest_gap_s']:.2f} s"
        lines.append(f"  {row['kind']:<12} {row['sensor']:<12} {row['count']:>7}  {rate:>10}  {gap}{late}")
    lines.append(f"truth: {about['truth']} poses" if about["truth"] else "truth: none, so errors cannot be scored")
    if about["prior"] is None:
        lines.append("start: none in the log")
    else:
        x, y, heading = about["prior"]
        turned = f"{math.degrees(heading):.1f}°" if about["heading_known"] else "unknown"
        place = f"x {x:.2f} m, y {y:.2f} m" if about["position_known"] else "position unknown"
        lines.append(f"start: {place}, heading {turned}")
    lines += [f"estimates of {name}: {count}" for name, count in about["estimators"].items()]
    lines += [f"warning: {warning}" for warning in about["warnings"]]
    return "\n".join(lines) + "\n"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion info`."""
    parser.add_argument("run", metavar="RUN", type=Path, help="the log, or a bag of another robot")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Tell what is in the log."""
    about = describe(arguments.run)
    sys.stdout.write(json.dumps(about, indent=2) + "\n" if arguments.json else _text(about))
    return 0
