"""`fusion import`: recordings of other formats become logs."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusion.errors import LogError, ParameterError, RecordingError, did_you_mean

KINDS = {
    "csv": "logs.importers.csv_bundle",
    "tuc": "logs.importers.tuc",
    "plaza": "logs.importers.plaza",
    "cdoa": "logs.importers.cdoa",
    "kolakowski": "logs.importers.kolakowski",
    "haiyao": "logs.importers.haiyao",
    "rosbag": "logs.importers.rosbag",
}
"""Kinds of recordings and the module that reads each; one has ``recordings(folder)``."""
OPEN = "rosbag"
"""The kind that does not say by itself what is what: its ``recordings`` takes options, and a file will do."""


def import_recordings(
    kind: str,
    folder: Path,
    output: Path,
    *,
    force: bool = False,
    **options: Any,  # noqa: ANN401 - a kind's
) -> list[Path]:
    """Write every run found in ``folder`` as a log; answers their paths.

    ``output`` ending in ``.mcap`` is one log, and the folder must hold one run; else a folder that gets one log a run.
    The kind `rosbag` takes a file as well, and the ``options`` of `logs.importers.rosbag.recordings`. What is
    lost or doubtful stands on stderr. A log that exists is written over only with ``force``, and nothing is written
    where one of several exists. Raises `RecordingError` for an unknown kind, a folder without such files, or a
    file that cannot be understood, `ParameterError` for options that the kind does not take, `LogError` for a log that
    exists.
    """
    if kind not in KINDS:
        raise RecordingError(f"there is no importer {kind!r}; {did_you_mean(kind, KINDS)}")
    if options and kind != OPEN:
        raise ParameterError(f"{kind} takes no {', '.join(sorted(options))}: its files say it; only {OPEN} does")
    if not folder.is_dir() and not (kind == OPEN and folder.is_file()):
        raise RecordingError(f"{folder}: no such folder; give the folder that holds the recording")
    found = list(importlib.import_module(KINDS[kind]).recordings(folder, **options))
    for warning in (warning for recording in found for warning in recording.doubts):
        sys.stderr.write(f"warning: {warning}\n")
    if output.suffix == ".mcap" and len(found) != 1:
        names = ", ".join(recording.name for recording in found)
        raise RecordingError(f"{folder} holds {len(found)} runs ({names}); give a folder with -o, not one file")
    paths = [output if output.suffix == ".mcap" else output / f"{recording.name}.mcap" for recording in found]
    for path in paths:
        if path.exists() and not (force and path.is_file()):
            raise LogError(f"{path}: exists already; choose another name, or write over a file with --force")
    return [recording.write(path) for recording, path in zip(found, paths, strict=True)]


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion import`."""
    parser.add_argument("kind", metavar="KIND", help=f"what wrote the recording: {', '.join(KINDS)}")
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="the folder with its files; a bag may be a file")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        required=True,
        help="a log (*.mcap), or a folder for one log per run",
    )
    parser.add_argument("--force", action="store_true", help="write over logs that exist")
    bag_options(parser.add_argument_group("rosbag only"))


def bag_options(bag: argparse._ArgumentGroup) -> None:
    """What a bag does not say by itself, for every verb that takes one."""
    bag.add_argument("--world", metavar="WORLD.toml", type=Path, help="the anchors and the robot")
    bag.add_argument(
        "--topic",
        metavar="ROLE=TOPIC",
        action="append",
        default=[],
        help="odom, wheels, gyro, range, range.ANCHOR, wifi or truth, and its topic; may be repeated",
    )
    bag.add_argument(
        "--truth-to-map",
        metavar=("X", "Y", "HEADING"),
        type=float,
        nargs=3,
        help="where the origin of the truth's frame is in the map [m, m, rad]",
    )


def run(arguments: argparse.Namespace) -> int:
    """Import and list what was written."""
    options = given_options(arguments)
    written = import_recordings(arguments.kind, arguments.folder, arguments.output, force=arguments.force, **options)
    for path in written:
        sys.stdout.write(f"{path}\n")
    return 0


def given_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Those of `bag_options` that were given, by the names `logs.importers.rosbag.recordings` has for them."""
    given = {
        "world": arguments.world,
        "topics": _topics(arguments.topic),
        "truth_to_map": arguments.truth_to_map,
    }
    return {name: value for name, value in given.items() if value}


def _topics(texts: Sequence[str]) -> dict[str, str]:
    """Roles and their topics, as ``ROLE=TOPIC``."""
    topics: dict[str, str] = {}
    for text in texts:
        role, equals, topic = (part.strip() for part in text.partition("="))
        if not equals:
            raise ParameterError(f"--topic {text}: names no topic; write ROLE=TOPIC, as in odom=/odom")
        if role in topics:
            raise ParameterError(f"--topic {text}: {role} is {topics[role]} already; give each role once")
        topics[role] = topic
    return topics
