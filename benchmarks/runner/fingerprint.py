"""A hash of the code that a stored result depends on. Code that decides no number does not count.

Ours is counted by rooms: verbs, output and the promises of the contract are left out, and import-linter holds that what
counts never imports them. Of another distribution everything counts.
"""

from __future__ import annotations

import hashlib
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from pathlib import Path

HOST = ("fusion", "logs")
"""The rooms that every result rests on: the host of the estimators, and the reader of the runs with their prior."""
DECIDES_NOTHING = ("fusion.conformance", "fusion.cli", "fusion.output", "logs.cli", "sensors.cli")
"""Packages of ours whose code decides no number."""
ROOM_OF_FAULTS = "benchmarks.faults"
"""Of `benchmarks`, the one package that an estimate rests on."""
SUFFIXES = (*SOURCE_SUFFIXES, *EXTENSION_SUFFIXES)


@cache
def fingerprint(module: str) -> str:
    """A hash of the sources that ``module`` rests on: of its top-level package, and of `HOST`."""
    package = ROOM_OF_FAULTS if module.startswith(f"{ROOM_OF_FAULTS}.") else module.partition(".")[0]
    total = hashlib.sha256()
    for name in sorted({package, *HOST}):
        for place, path in _sources(name):
            total.update(place.encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def _sources(name: str) -> list[tuple[str, Path]]:
    """The files of a package or module, each with its place in it; those of `DECIDES_NOTHING` are left out."""
    loaded = import_module(name)
    if not hasattr(loaded, "__path__"):
        return [(name, Path(str(loaded.__file__)))]
    left_out = tuple(f"{one.replace('.', '/')}/" for one in DECIDES_NOTHING)
    # A package without __init__.py has no file of its own, and may have several folders.
    files = [(folder, path) for folder in loaded.__path__ for path in Path(folder).rglob("*")]
    places = [(f"{name.replace('.', '/')}/{path.relative_to(folder).as_posix()}", path) for folder, path in files]
    return sorted(one for one in places if one[0].endswith(SUFFIXES) and not one[0].startswith(left_out))
