"""Results by the hash of everything they depend on: what is there is never computed again.

A folder of entries, each written beside its place and then moved there in one step, so that a reader, or a runner that
was killed, never meets half of one. There are no locks: two runners that compute the same entry write the same bytes.
Two stores are merged by copying one into the other.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from fusion import FusionError


def key_of(spec: Mapping[str, object]) -> str:
    """SHA-256 of a table of plain values, the same whatever the order of its keys.

    >>> key_of({"b": 1, "a": [2.5, None]}) == key_of({"a": [2.5, None], "b": 1})
    True
    """
    canonical = json.dumps(spec, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


class Store:
    """Entries of several kinds under one folder; each is a few named files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def place(self, kind: str, key: str) -> Path:
        """The folder of an entry, whether it is there or not."""
        return self.folder / kind / key[:2] / key[2:]

    def has(self, kind: str, key: str) -> bool:
        """True where the entry is there, whole."""
        return self.place(kind, key).is_dir()

    def read(self, kind: str, key: str, name: str) -> bytes:
        """One file of an entry; raises `FusionError` when it is not there."""
        path = self.place(kind, key) / name
        try:
            return path.read_bytes()
        except OSError as error:
            raise FusionError(f"{path}: cannot be read ({error.strerror}); delete its folder and run again") from error

    def read_json(self, kind: str, key: str, name: str) -> Any:  # noqa: ANN401 - whatever was written
        """One file of an entry as JSON; raises `FusionError` when it is damaged, as after a disk that was full."""
        try:
            return json.loads(self.read(kind, key, name))
        except ValueError as error:
            raise self.damaged(kind, key, name, error) from error

    def damaged(self, kind: str, key: str, name: str, error: Exception) -> FusionError:
        """The error for a file of an entry that is not as it was written."""
        path = self.place(kind, key) / name
        return FusionError(f"{path}: is damaged ({error}); delete {path.parent} and run again")

    def write(self, kind: str, key: str, files: Mapping[str, bytes]) -> None:
        """Put an entry in its place; one that is there already is left as it is. Raises `FusionError`."""
        place = self.place(kind, key)
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            beside = Path(tempfile.mkdtemp(prefix=".", dir=place.parent))
            for name, content in files.items():
                (beside / name).write_bytes(content)
            _move(beside, place)
        except OSError as error:
            raise FusionError(f"{place}: cannot be written ({error.strerror}); give another --store") from error

    def discard(self, kind: str, key: str) -> None:
        """Take an entry away, in one step; one that is not there, or that another runner takes, is no matter."""
        place = self.place(kind, key)
        with suppress(OSError):
            beside = Path(tempfile.mkdtemp(prefix=".", dir=place.parent))
            os.replace(place, beside)
            shutil.rmtree(beside, ignore_errors=True)


def _move(beside: Path, place: Path) -> None:
    try:
        os.replace(beside, place)
    except OSError:
        shutil.rmtree(beside, ignore_errors=True)
        if not place.is_dir():
            raise


def to_json(value: object) -> bytes:
    """Strict JSON, one line a key, the same bytes for the same value."""
    # An indent would do that too, but by the encoder that is written in Python, and ten times slower.
    return (json.dumps(value, sort_keys=True, separators=(",\n", ": "), allow_nan=False) + "\n").encode()


STORE = Path("fusion-bench")
