"""`fusion join`: the files of one recording become one log, message for message, with the diagnostics of devices."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from fusion import LogError, World
from logs.message_stream import Walk
from logs.writer import RUN_RECORD, RunWriter


class Part(NamedTuple):
    """One file of a recording: which recording it belongs to, and its place in it."""

    path: Path
    recording: str
    split: int
    about: dict[str, str]


def join(files: Sequence[Path], output: Path) -> tuple[str, ...]:
    """Write the parts of one recording (or a folder of them) to ``output``; answers what is lost, in sentences.

    Raises `LogError` where the files are not parts of one recording, or ``output`` exists.
    """
    parts = _parts(files)
    if output.exists():
        raise LogError(f"{output}: is there already; remove it, or choose another name")
    first = parts[0].about
    about = _common(first)
    warnings = list(_gaps(parts))
    world = World.from_table(json.loads(first["world"]))
    with RunWriter(output, world, name=parts[0].recording, metadata=about) as log:
        for part in parts:
            walk = Walk(part.path)
            for source, message in walk:
                log.copy(source.topic, source.type, message)
            warnings += walk.warnings
        if late := {key: value for key, value in _common(walk.metadata[RUN_RECORD]).items() if key not in about}:
            log.note(late)  # what the recorder knew only at its end stands in the last file
    return tuple(warnings)


def _common(about: Mapping[str, str]) -> dict[str, str]:
    """The metadata of one file that belong to the whole recording."""
    return {key: value for key, value in about.items() if key not in ("name", "world", "world_hash", "split")}


def _parts(files: Sequence[Path]) -> list[Part]:
    """The parts in their order; a folder stands for the logs in it."""
    paths = [path for file in files for path in (sorted(file.glob("*.mcap")) if file.is_dir() else [file])]
    parts = sorted((_part(path) for path in paths), key=lambda part: part.split)
    recordings = sorted({part.recording for part in parts})
    if not parts:
        raise LogError(f"{', '.join(map(str, files))}: no log is there; give the files of one recording")
    if len(recordings) > 1:
        raise LogError(f"{len(recordings)} recordings are given ({', '.join(recordings)}); give the files of one")
    for one, other in pairwise(parts):
        if one.split == other.split:
            raise LogError(f"{one.path} and {other.path} are the same part of {one.recording}; give it once")
    return parts


def _part(path: Path) -> Part:
    walk = Walk(path)
    next(iter(walk), None)
    about = walk.metadata.get(RUN_RECORD, {})
    if "recording" not in about:
        raise LogError(f"{path}: is no part of a recording; `fusion record` writes such files")
    return Part(path, about["recording"], int(about["split"]), about)


def _gaps(parts: Sequence[Part]) -> list[str]:
    missing = sorted({*range(parts[-1].split + 1)} - {part.split for part in parts})
    return [f"{parts[0].recording}: part {number} is missing" for number in missing]


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion join`."""
    parser.add_argument("files", metavar="FILE", type=Path, nargs="+", help="the files of one recording, or its folder")
    parser.add_argument("-o", "--output", metavar="OUT", type=Path, required=True, help="the log to write (*.mcap)")


def run(arguments: argparse.Namespace) -> int:
    """Join and name the log."""
    for warning in join(arguments.files, arguments.output):
        sys.stderr.write(f"warning: {warning}\n")
    sys.stdout.write(f"{arguments.output}\n")
    return 0
