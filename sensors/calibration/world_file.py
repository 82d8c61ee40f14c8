"""A world with calibrated numbers in it: everything else of its file stays, comments too."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Any

from fusion import World, WorldError
from fusion.output.files import write
from fusion.world import Calibration
from sensors.calibration.provenance import significant

TomlTable = Mapping[str, Any]
"""Nested tables of names and values, as TOML has them."""


def calibrated_text(
    text: str, changes: TomlTable, anchors: Mapping[str, TomlTable], name: str, record: Calibration
) -> str:
    """The world file ``text`` with ``changes``, those of single ``anchors`` by id, and where they come from, under
    ``[calibration.name]``. Raises `WorldError` where the result is no world any more.
    """
    import tomlkit

    document = tomlkit.parse(text)
    for row in document.get("anchors", ()):
        _put(row, anchors.get(str(row["id"]), {}), inline=True)
    _put(document, changes, inline=False)
    _put(document, {"calibration": {name: dataclasses.asdict(record)}}, inline=False)
    made = tomlkit.dumps(document)
    World.from_toml(made)
    return made


def _put(document: MutableMapping[str, Any], changes: TomlTable, *, inline: bool) -> None:
    """Set what differs, leave the rest of the text alone; an anchor's own new table stands in its line."""
    import tomlkit

    for key, value in changes.items():
        if isinstance(value, Mapping):
            if key not in document:
                document[key] = tomlkit.inline_table() if inline else tomlkit.table()
            _put(document[key], value, inline=inline)
        elif document.get(key) != _plain(value):
            document[key] = _plain(value)


def _plain(value: object) -> object:
    if isinstance(value, float):
        return significant(value)
    return list(value) if isinstance(value, tuple) else value


def world_text(world: World, path: Path | None) -> str:
    """The text of a world file, or a fresh one of the world in a log, which holds no comments."""
    import tomlkit

    if path is None:
        return tomlkit.dumps(_without_none(json.loads(world.table)))
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise WorldError(f"{path}: cannot be read ({error}); give a world file in TOML") from error


def _without_none(table: Any) -> Any:  # noqa: ANN401 - whatever a table holds
    """TOML has no word for nothing; a key that is left out means the same."""
    if isinstance(table, dict):
        return {key: _without_none(value) for key, value in table.items() if value is not None}
    return [_without_none(value) for value in table] if isinstance(table, list) else table


def write_world(output: Path, text: str) -> None:
    """Raises `FusionError` where it cannot be written."""
    write(output, text.encode())
