"""`fusion import`: recordings of other formats become logs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from fusion.errors import LogError, ParameterError, PluginError, RecordingError
from fusion.plugins import IMPORTERS, load, names, parameters
from logs.importers.foreign_recording import Recording


def import_recordings(
    kind: str,
    source: Path,
    output: Path,
    *,
    force: bool = False,
    **options: Any,  # noqa: ANN401 - a kind's
) -> list[Path]:
    """Write every run found in ``source``, a folder or a file, as a log; answers their paths.

    ``kind`` is the name of an installed importer (`fusion.plugins.IMPORTERS`): a function of ``source``, and of those
    ``options`` that it names, which answers `Recording`s. ``output`` ending in ``.mcap`` is one log, and the source
    must hold one run; else a folder that gets one log a run. A log that exists is written over only with ``force``, and
    nothing is written where one of several exists. Warnings of lost or doubtful data stand on stderr. Raises
    `PluginError` for an importer that is not there or is broken, `RecordingError` for a source without such files or
    with one that cannot be understood, `ParameterError` for options that the kind does not take,
    `LogError` for a log that exists.
    """
    read = load(kind, IMPORTERS)
    known = parameters(read)
    if others := sorted(options.keys() - known):
        raise ParameterError(f"{kind} takes no {', '.join(others)}; leave that out")
    if lacking := [name for name, one in known.items() if one.default is one.empty and name not in options]:
        raise ParameterError(f"{kind} needs {', '.join(lacking)}; `fusion import --help` shows the options there are")
    if not source.exists():
        raise RecordingError(f"{source}: no such folder; give the folder that holds the recording")
    recordings = _recordings(kind, read(source, **options))
    for warning in (warning for recording in recordings for warning in recording.doubts):
        sys.stderr.write(f"warning: {warning}\n")
    paths = _free_paths(output, recordings, force=force)
    return [recording.write(path) for recording, path in zip(recordings, paths, strict=True)]


def _free_paths(output: Path, recordings: Sequence[Recording], *, force: bool) -> list[Path]:
    if output.suffix == ".mcap" and len(recordings) != 1:
        run_names = ", ".join(recording.name for recording in recordings)
        raise RecordingError(
            f"the folder holds {len(recordings)} runs ({run_names}); give a folder with -o, not one file"
        )
    paths = [output if output.suffix == ".mcap" else output / f"{recording.name}.mcap" for recording in recordings]
    for path in paths:
        if path.exists() and not (force and path.is_file()):
            raise LogError(f"{path}: exists already; choose another name, or write over a file with --force")
    return paths


def _recordings(kind: str, answer: object) -> list[Recording]:
    recordings = []
    for one in answer if isinstance(answer, Iterable) else [answer]:
        if not isinstance(one, Recording):
            raise PluginError(f"the importer {kind} answered {one!r}; it must answer `Recording`s (docs/plugin.md)")
        recordings.append(one)
    return recordings


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion import`."""
    parser.add_argument("kind", metavar="KIND", help=f"the importer: {', '.join(names(IMPORTERS))}")
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
    bag_options(parser.add_argument_group("rosbag, and other importers that take them"))


def bag_options(bag: argparse._ArgumentGroup) -> None:
    """Options for what a bag does not state by itself, for every verb that takes one."""
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
