"""`fusion import`: recordings of other formats become logs."""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

from fusion.errors import RecordingError, did_you_mean

KINDS = {
    "csv": "logs.csv_bundle",
    "tuc": "logs.tuc",
    "plaza": "logs.plaza",
    "cdoa": "logs.cdoa",
    "kolakowski": "logs.kolakowski",
    "haiyao": "logs.haiyao",
}
"""Kinds of recordings and the module that reads each; one has ``recordings(folder)``."""


def import_recordings(kind: str, folder: Path, output: Path) -> list[Path]:
    """Write every run found in ``folder`` as a log; answers their paths.

    ``output`` ending in ``.mcap`` is one log, and the folder must hold one run; else a folder that gets one log a run.
    Raises `RecordingError` for an unknown kind, a folder without such files, or a file that cannot be understood.
    """
    if kind not in KINDS:
        raise RecordingError(f"there is no importer {kind!r}; {did_you_mean(kind, KINDS)}")
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; give the folder that holds the recording")
    found = list(importlib.import_module(KINDS[kind]).recordings(folder))
    if output.suffix != ".mcap":
        return [recording.write(output / f"{recording.name}.mcap") for recording in found]
    if len(found) != 1:
        names = ", ".join(recording.name for recording in found)
        raise RecordingError(f"{folder} holds {len(found)} runs ({names}); give a folder with -o, not one file")
    return [found[0].write(output)]


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion import`."""
    parser.add_argument("kind", metavar="KIND", help=f"what wrote the recording: {', '.join(KINDS)}")
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="the folder with its files")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        required=True,
        help="a log (*.mcap), or a folder for one log per run",
    )


def run(arguments: argparse.Namespace) -> int:
    """Import and list what was written."""
    for path in import_recordings(arguments.kind, arguments.folder, arguments.output):
        sys.stdout.write(f"{path}\n")
    return 0
