"""Sources of a site: a world file, a scenario or a log, and the radios in use there."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import NamedTuple

from fusion import Ranges, WifiScan, World
from fusion.radio import RadioKind
from logs.reader import read_run
from sensors.simulation.scenario import load_scenario


class Site(NamedTuple):
    """A world, and which radios are in use there; none where its source has nothing of that."""

    world: World
    radios: frozenset[RadioKind]


def load_site(source: str | Path) -> Site:
    """The world of a world file, a scenario (file or built-in name) or a log, and the radios in use there."""
    path = Path(source)
    if path.suffix == ".mcap":
        run = read_run(path)
        kinds = {type(measurement) for measurement in run.measurements}
        return Site(run.world, _radios(WifiScan in kinds, Ranges in kinds))
    if path.suffix != ".toml" or _is_scenario(path):
        scenario = load_scenario(source)
        reality = scenario.reality
        return Site(scenario.world, _radios(reality.wifi_hz or reality.scans_at_stop, reality.range_hz))
    world = World.load(path)
    table = json.loads(world.table)
    parts = [table, *table.get("anchors", ())]
    return Site(world, _radios(any("radio" in part for part in parts), any("ranging" in part for part in parts)))


def _is_scenario(path: Path) -> bool:
    """A scenario holds its world in a table; a file that cannot be read is left to the reader of worlds to refuse."""
    try:
        return isinstance(tomllib.loads(path.read_text(encoding="utf-8")).get("world"), dict)
    except (OSError, ValueError):
        return False


def _radios(rssi: float, ranges: float) -> frozenset[RadioKind]:
    radios: list[tuple[RadioKind, float]] = [("rssi", rssi), ("range", ranges)]
    return frozenset(radio for radio, used in radios if used)


def choose_radio(radios: frozenset[RadioKind]) -> tuple[RadioKind, str]:
    """The one radio in use, or else signal strength; and a sentence about the choice."""
    if len(radios) == 1:
        (radio,) = radios
        return radio, f"{radio} readings, the only kind this site has"
    has = "both kinds" if radios else "neither [radio] nor [ranging]"
    return "rssi", f"rssi readings, since the site has {has}; --radio range for the other"
