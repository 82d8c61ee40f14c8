"""`fusion estimators`: what is installed, with every parameter. One broken plug-in does not hide the others."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fusion.errors import NotInstalledError, PluginError
from fusion.plugins import load, names, parameters


def installed() -> list[dict[str, Any]]:
    """One entry per declared estimator: name, summary, tags, parameters; or name and error."""
    return [_entry(name) for name in names()]


def _entry(name: str) -> dict[str, Any]:
    try:
        return _description(name, load(name))
    except NotInstalledError as error:
        return {"name": name, "error": error.cause}
    except PluginError as error:
        return {"name": name, "error": str(error)}
    except Exception as error:  # noqa: BLE001 - a stranger's class may lack or break anything
        return {"name": name, "error": f"it is no estimator: {error!r}; it needs summary, tags and typed parameters"}


def _description(name: str, made: Any) -> dict[str, Any]:  # noqa: ANN401 - whatever the entry point names
    options = [
        {"name": key, "type": getattr(item.annotation, "__name__", str(item.annotation)), "default": item.default}
        for key, item in parameters(made).items()
    ]
    return {"name": name, "summary": made.summary, "tags": sorted(t.value for t in made.tags), "parameters": options}


def _text(entry: dict[str, Any]) -> str:
    if "error" in entry:
        return f"{entry['name']}: cannot be used: {entry['error']}\n"
    tags = f" [{', '.join(entry['tags'])}]" if entry["tags"] else ""
    rows = "".join(f"    {p['name']}: {p['type']} = {p['default']!r}\n" for p in entry["parameters"])
    return f"{entry['name']}: {entry['summary']}{tags}\n{rows}"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion estimators`."""
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments: argparse.Namespace) -> int:
    """List what is installed."""
    show(installed(), _text, as_json=arguments.json)
    return 0


def show(entries: Sequence[Mapping[str, Any]], text: Callable[[Any], str], *, as_json: bool) -> None:
    """Print what is installed: a line or more each by ``text``, or one JSON list."""
    as_text = json.dumps(entries, indent=2, default=str) + "\n" if as_json else "".join(map(text, entries))
    sys.stdout.write(as_text)
