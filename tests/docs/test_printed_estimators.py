"""The estimators that README and docs print, installed as a stranger's package, keep every promise of the contract."""

import re
import sys
import tomllib
from pathlib import Path

import pytest

from fusion.conformance.checks import Outcome, run_checks

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PLUGIN = (ROOT / "docs" / "plugin.md").read_text(encoding="utf-8")
DECLARED = tomllib.loads(re.search(r"```toml\n(.*?)```", PLUGIN, re.DOTALL)[1])
ENTRY_POINTS = {
    **DECLARED["project"]["entry-points"]["fusion.estimators"],
    "ellipse": "my_package.my_module:Ellipse",
    "wheels": "my_package.readme:Wheels",
}


def python_of(page):
    return "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory):
    """As after `pip install`: the modules and the metadata of a distribution in a folder of the path."""
    site = tmp_path_factory.mktemp("site")
    files = {
        "my_package/my_module.py": python_of(PLUGIN),
        "my_package/readme.py": python_of(README),
        "my_package-1.dist-info/METADATA": "Name: my_package\nVersion: 1\n",
        "my_package-1.dist-info/entry_points.txt": "\n".join(
            ["[fusion.estimators]", *(f"{name} = {place}" for name, place in ENTRY_POINTS.items())]
        ),
    }
    for name, text in files.items():
        (site / name).parent.mkdir(exist_ok=True)
        (site / name).write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_package"]:
        del sys.modules[name]


def test_every_printed_estimator_is_among_those_checked():
    printed = {*re.findall(r"^class (\w+)(?!.*NamedTuple)", python_of(README) + python_of(PLUGIN), re.MULTILINE)}
    assert printed == {place.partition(":")[2] for place in ENTRY_POINTS.values()}


@pytest.mark.parametrize("name", ENTRY_POINTS)
def test_printed_estimator_keeps_every_promise(name):
    verdicts = run_checks(name)
    assert [(one.id, one.detail) for one in verdicts if one.outcome is Outcome.BROKEN] == []


def test_plugin_of_the_readme_has_as_many_lines_as_its_heading_states():
    (lines,) = re.findall(r"^## A plug-in in (\d+) lines$", README, re.MULTILINE)
    assert len(python_of(README).splitlines()) == int(lines)
