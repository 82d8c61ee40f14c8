"""Results that leave the program: written whole, or refused in one sentence."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

from fusion.errors import FusionError


def require_place(path: Path) -> None:
    """Raises `FusionError` now for a place that `write` could not write to: before minutes of work are spent."""
    if path == Path("-"):
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FusionError(f"{path}: cannot be written ({error.strerror}); give another place") from error
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise FusionError(f"{path}: cannot be written; give a file in a folder that can be written to")


def write(path: Path, content: bytes) -> None:
    """Into a file, its folder made where it is missing; ``-`` is stdout. Raises `FusionError`."""
    if path == Path("-"):
        sys.stdout.write(content.decode())
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _write_whole(path.resolve(), content)
    except OSError as error:
        raise FusionError(f"{path}: cannot be written ({error.strerror}); give another place") from error


def _write_whole(path: Path, content: bytes) -> None:
    """Into a file beside it first: where the disk is full, what was there stays, and no half file does."""
    if path.exists() and not path.is_file():
        path.write_bytes(content)  # a device or a pipe, which keeps its place
        return
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_bytes(content)
        if path.exists():
            shutil.copymode(path, beside)
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def write_json(path: Path, record: object, *, indent: int | None = None) -> None:
    """`write` of strict JSON: the same bytes for the same record."""
    write(path, (json.dumps(record, indent=indent, allow_nan=False, default=str) + "\n").encode())
