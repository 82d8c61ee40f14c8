"""`fusion sensors`: the installed drivers, and the devices of each that are present."""

from __future__ import annotations

import argparse
from typing import Any

from fusion import FusionError, load, names
from fusion.cli.estimators import show
from fusion.plugins import SENSORS


def drivers() -> list[dict[str, Any]]:
    """One entry per installed driver: name, summary, devices present; or name and error."""
    return [_entry(name) for name in names(SENSORS)]


def _entry(name: str) -> dict[str, Any]:
    try:
        made = load(name, SENSORS)
        devices = [{**device._asdict(), "settings": dict(device.settings)} for device in made.discover()]
    except FusionError as error:
        return {"name": name, "error": str(error)}
    except Exception as error:  # noqa: BLE001 - a stranger's driver may lack or break anything
        return {"name": name, "error": f"it is no driver: {error!r}; try `fusion check --driver {name}`"}
    return {"name": name, "summary": made.summary, "devices": devices}


def _text(entry: dict[str, Any]) -> str:
    if "error" in entry:
        return f"{entry['name']}: cannot be used: {entry['error']}\n"
    rows = "".join(f"    {device['id']}: {device['about']} {device['settings'] or ''}\n" for device in entry["devices"])
    return f"{entry['name']}: {entry['summary']}\n{rows}"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion sensors`."""
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments: argparse.Namespace) -> int:
    """List drivers and devices."""
    show(drivers(), _text, as_json=arguments.json)
    return 0
