"""Every Python block of README and docs runs, page by page; the world file of the docs loads; what they name exists."""

import importlib
import re
import tomllib
from pathlib import Path

import pytest

from benchmarks.runner.suite_file import load_suite
from fusion import World
from fusion.cli.verbs import VERBS

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
TEXTS = [*PAGES, ROOT / "CHANGELOG.md"]
ROOMS = "fusion|sensors|estimators|logs|benchmarks"


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_of_a_page_runs_from_top_to_bottom(page):
    source = "\n".join(blocks(page, "python"))
    exec(compile(source, str(page), "exec"), {"__name__": "docs"})


def test_world_file_of_the_docs_loads_and_states_the_defaults():
    (text,) = blocks(ROOT / "docs" / "world.md", "toml")
    world = World.from_toml(text)
    assert [anchor.id for anchor in world.anchors] == ["ap1", "ap2", "ap3"]
    assert world.anchor("ap3").ranging.offset_m == 0.12
    bare = World.from_table({"anchors": [{"id": "a", "position_m": [0, 0]}]})
    assert world.robot.noise == bare.robot.noise
    assert world.anchor("ap1").radio == bare.anchors[0].radio


def test_suite_of_the_docs_is_a_suite(tmp_path):
    (text,) = blocks(ROOT / "docs" / "benchmark.md", "toml")
    (tmp_path / "hall.toml").write_text(text, encoding="utf-8")
    suite = load_suite(tmp_path / "hall.toml")
    assert [estimator.params for estimator in suite.estimators] == [
        {"gate_probability": 0.99},
        {"gate_probability": 0.999},
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_shown_exists(page):
    for line in "\n".join(blocks(page, "sh")).splitlines():
        for verb in re.findall(r"(?:^|; |: )fusion (\w+)", line.partition("#")[0]):
            assert verb in VERBS, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_page_linked_to_exists(page):
    for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.name)
def test_every_python_name_of_a_page_exists(page):
    for room, rest in re.findall(rf"`({ROOMS})((?:\.\w+)+)(?=[`(])", page.read_text(encoding="utf-8")):
        assert resolved([room, *rest.strip(".").split(".")]) is not None, room + rest


def resolved(parts):
    """The object of a dotted name: modules as far as there are any, then attributes."""
    found = importlib.import_module(parts[0])
    for k, part in enumerate(parts[1:], start=2):
        found = getattr(found, part, None) or importlib.import_module(".".join(parts[:k]))
    return found


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.name)
def test_every_script_named_exists(page):
    for script in re.findall(r"\w[\w/]*/[a-z0-9_]+\.py\b", page.read_text(encoding="utf-8")):
        assert (ROOT / script).is_file(), script


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: page.name)
def test_every_test_named_exists(page):
    """By its whole name, by its beginning with an ellipsis, or by its file."""
    paths = list((ROOT / "tests").rglob("test_*.py"))
    tests = [name for path in paths for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.M)]
    for name, end in re.findall(r"`(test_\w+?)(…|\.py)?`", page.read_text(encoding="utf-8")):
        if end == ".py":
            assert name in [path.stem for path in paths], name
        else:
            assert any(test == name or (end and test.startswith(name)) for test in tests), name


def extras():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)["project"]["optional-dependencies"].keys() - {"test"}


def test_readme_lists_every_extra_with_its_size():
    (table,) = re.findall(
        r"^\| extra \|.*\n((?:\|.*\n)+)", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert set(re.findall(r"^\| `?(\w+)`? \|.* \d+ \|$", table, re.MULTILINE)) == {*extras(), "none"}


def test_every_remedy_names_an_extra_that_exists():
    sources = [path for room in ROOMS.split("|") for path in (ROOT / room).rglob("*.py")]
    texts = [path.read_text(encoding="utf-8") for path in [*sources, *PAGES]]
    named = {name for text in texts for name in re.findall(r"fusion-localization\[(\w+)\]", text)}
    assert named <= extras(), named - extras()
    assert named
