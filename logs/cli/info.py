"""`fusion info`: what is in a log, whether anything is wrong with it, and which estimators could use it."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fusion import FusionError, Measurement, Radio
from fusion.plugins import left_out
from fusion.values import seconds
from logs.cli.info_text import info_text
from logs.devices import complaints, devices, dropped, wall_clock
from logs.importers.bag import open_bag
from logs.importers.topic_assignment import roles_of
from logs.prior import begin_ns
from logs.reader import holds_run, read_log
from logs.run import Run
from logs.timing import Stream
from logs.usability import usability


def describe(path: Path) -> dict[str, Any]:
    """Everything that `fusion info` shows, as plain values: times in seconds, rates in hertz.

    A bag of another robot is described topic by topic, under the key ``topics``.
    """
    if path.is_dir() or not holds_run(path):
        return _describe_bag(path)
    log = read_log(path)
    run = log.run
    return {
        "path": str(path),
        "name": run.name,
        "world": run.world.name,
        "world_hash": run.world.hash,
        **_anchors(run),
        "duration_s": _duration_s(run),
        "channels": _channels(log.arrivals, begin_ns(run.measurements)),
        "truth": 0 if run.truth is None else len(run.truth),
        "true_headings": 0 if run.truth is None else int(np.isfinite(run.truth.heading).sum()),
        "prior": None if run.prior is None else [n if math.isfinite(n) else None for n in run.prior.pose],
        "position_known": run.prior is not None and run.prior.position_known,
        "heading_known": run.prior is not None and run.prior.heading_known,
        "estimators": {name: len(estimates) for name, estimates in run.lanes.items()},
        "usability": [verdict.record() for verdict in usability(run)],
        "left_out": left_out(),
        "wall_clock": wall_clock(run.clocks, begin_ns(run.measurements)),
        "devices": devices(run.diagnostics),
        "complaints": dict(complaints(run.diagnostics)),
        "dropped": dropped(run.diagnostics),
        "metadata": dict(run.metadata),
        "damage": log.damage.record() if log.damage is not None and str(log.damage) else None,
        "warnings": list(run.warnings),
    }


def _describe_bag(path: Path) -> dict[str, Any]:
    bag = open_bag(path, keep=lambda _kind, _sample: False)
    filled = [topic for topic in bag.topics.values() if topic.count]
    first_ns = min((topic.first_ns for topic in filled), default=0)
    last_ns = max((topic.last_ns for topic in filled), default=0)
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


def _anchors(run: Run) -> dict[str, Any]:
    """The anchors of the world, and the number of readings of each anchor, known or not."""
    scans = (measurement for measurement in run.measurements if isinstance(measurement, Radio))
    counts = Counter(reading.anchor for scan in scans for reading in scan.readings)
    known = [anchor.id for anchor in run.world.anchors]
    return {
        "anchors": known,
        "readings": {anchor: counts[anchor] for anchor in known},
        "unknown_anchors": {anchor: counts[anchor] for anchor in sorted(counts.keys() - set(known))},
    }


def _duration_s(run: Run) -> float:
    start_ns = begin_ns(run.measurements)
    return seconds(max((measurement.time_ns for measurement in run.measurements), default=start_ns) - start_ns)


def _channels(arrivals: Sequence[tuple[int, Measurement]], start_ns: int) -> list[dict[str, Any]]:
    """One row per sensor: how much, how often, and what is odd about its times."""
    by_sensor: dict[tuple[str, str], list[tuple[int, int, int]]] = defaultdict(list)
    for log_ns, measurement in arrivals:
        row = (measurement.time_ns, log_ns, measurement.seq)
        by_sensor[type(measurement).__name__, measurement.sensor].append(row)
    return [
        {"kind": kind, "sensor": sensor, **Stream(*np.array(rows, dtype=np.int64).T).timing(start_ns)}
        for (kind, sensor), rows in sorted(by_sensor.items())
    ]


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion info`."""
    runs = "a log, a folder of logs, or a bag of another robot"
    parser.add_argument("runs", metavar="RUN", type=Path, nargs="+", help=runs)
    parser.add_argument("--json", action="store_true", help="as JSON: an object, or a list of them for several files")


def run(arguments: argparse.Namespace) -> int:
    """Describe each log; one that cannot be read does not keep the others from being described."""
    described = []
    paths = [path for given in arguments.runs for path in _logs(given)]
    for path in paths:
        try:
            described.append(describe(path))
        except FusionError as error:
            sys.stderr.write(f"fusion info: {error}\n")
    several = paths != arguments.runs or len(paths) > 1
    if not arguments.json:
        sys.stdout.write("\n".join([*map(info_text, described), *_parts(arguments.runs, described)]))
    elif described or several:
        sys.stdout.write(json.dumps(described if several else described[0], indent=2) + "\n")
    return int(len(described) < len(paths))


def _logs(given: Path) -> list[Path]:
    """The logs in a folder of ours; of a bag, which may be a folder of one recording, itself."""
    inside = sorted(given.glob("*.mcap")) if given.is_dir() else []
    return inside if any(map(_is_log, inside)) else [given]


def _is_log(path: Path) -> bool:
    try:
        return holds_run(path)
    except FusionError:
        return False


def _parts(given: Sequence[Path], described: Sequence[dict[str, Any]]) -> list[str]:
    """The command that makes one log of them, where all are the parts of one recording."""
    recordings = {about.get("metadata", {}).get("recording") for about in described}
    if len(described) < 2 or len(recordings) > 1 or None in recordings:
        return []
    return [f"parts of one recording; one log of them: fusion join {' '.join(map(str, given))} -o RUN.mcap\n"]
