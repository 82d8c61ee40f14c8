"""Results that leave the program: written whole, or told in one sentence why not."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from fusion import FusionError


def write(path: Path, content: bytes) -> None:
    """Into a file, its folder made where it is missing; ``-`` is stdout. Raises `FusionError`."""
    if path == Path("-"):
        sys.stdout.write(content.decode())
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    except OSError as error:
        raise FusionError(f"{path}: cannot be written ({error.strerror}); give another place") from error


def write_json(path: Path, record: object, *, indent: int | None = None) -> None:
    """`write` of strict JSON: the same bytes for the same record."""
    write(path, (json.dumps(record, indent=indent, allow_nan=False, default=str) + "\n").encode())
