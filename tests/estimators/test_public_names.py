"""Our estimators use no door that a stranger lacks: they import from `fusion` what `docs/plugin.md` documents."""

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

import fusion

ROOT = Path(__file__).resolve().parents[2]
ROWS = re.findall(r"^\| `(fusion\.\w+)` \| (.*?) \|", (ROOT / "docs" / "plugin.md").read_text("utf-8"), re.MULTILINE)
DOCUMENTED = {"fusion": set(fusion.__all__), **{module: set(re.findall(r"`(\w+)`", names)) for module, names in ROWS}}
ESTIMATORS = sorted((ROOT / "estimators").glob("*.py"))


def undocumented(source):
    """The names of `fusion` that the source of a module imports, but no public page documents."""
    imports = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import | ast.ImportFrom)]
    whole = [name.name for node in imports if isinstance(node, ast.Import) for name in node.names]
    return [name for name in whole if name.partition(".")[0] == "fusion" and name != "fusion"] + [
        f"{node.module}.{name.name}"
        for node in imports
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "fusion"
        for name in node.names
        if name.name not in DOCUMENTED.get(node.module, ())
    ]


@pytest.mark.parametrize("path", ESTIMATORS, ids=lambda path: path.stem)
def test_estimator_imports_documented_names_alone(path):
    assert undocumented(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("from fusion.screen import screen", ["fusion.screen.screen"]),
        ("from fusion.fates import judged, refused", ["fusion.fates.refused"]),
        ("from fusion import Fold, values", ["fusion.values"]),
        ("import fusion.timeline as line", ["fusion.timeline"]),
        ("def late():\n    from fusion.odometry import Odometer", ["fusion.odometry.Odometer"]),
        ("import fusion\nfrom fusionreactor import core\nfrom math import pi", []),
    ],
)
def test_undocumented_import_is_noticed(source, names):
    assert undocumented(source) == names


def test_documented_names_are_there_and_have_docstrings():
    assert len(ROWS) > 5
    for module, names in DOCUMENTED.items():
        for name in names:
            value = getattr(importlib.import_module(module), name)
            assert inspect.getdoc(value) or not callable(value), f"{module}.{name}"


def test_every_documented_helper_is_used_by_an_estimator():
    sources = [path.read_text(encoding="utf-8") for path in ESTIMATORS]
    helpers = {name for module, names in DOCUMENTED.items() if module != "fusion" for name in names}
    assert [name for name in sorted(helpers) if not any(re.search(rf"\b{name}\b", text) for text in sources)] == []
