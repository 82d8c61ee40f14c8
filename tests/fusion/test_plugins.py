"""Plug-ins that cannot be brought in are refused with the reason, and none hides the others."""

import argparse
import importlib.metadata
import json
import pickle
import sys
from importlib.metadata import EntryPoint

import pytest

import fusion
from fusion import NotInstalledError, PluginError
from fusion.cli import estimators as listing
from fusion.cli.main import main
from fusion.plugins import FAULTS, IMPORTERS, SENSORS, VERBS, left_out

GROUP = "fusion.estimators"


@pytest.fixture
def installed(monkeypatch):
    """Further entry points, as other distributions would declare them."""
    ours = list(importlib.metadata.entry_points(group=GROUP))

    def install(*more):
        entries = [*ours, *(EntryPoint(name, value, GROUP) for name, value in more)]
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: entries if group == GROUP else [])

    return install


def test_name_claimed_twice_names_both(installed):
    installed(("ekf", "stranger.filters:Ekf"))
    with pytest.raises(PluginError, match=r"claimed twice \(.*estimators.ekf:Ekf.*stranger.filters:Ekf"):
        fusion.load("ekf")


def test_plugin_whose_own_package_is_missing_is_not_installed(installed):
    installed(("lost", "no_such_package.filters:Lost"))
    with pytest.raises(NotInstalledError, match="lost: not installed, the package no_such_package is missing; install"):
        fusion.load("lost")


def test_remedy_is_the_smallest_extra_that_brings_the_missing_package(stranger):
    with pytest.raises(NotInstalledError) as caught:
        fusion.load("lacking_one")
    assert str(caught.value) == f"lacking_one: {stranger}"
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize("name", ["filterpy_ekf", "filterpy_ukf"])
def test_missing_filterpy_is_named_with_the_extra_that_brings_it(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "filterpy", None)
    for module in ("estimators.filterpy_ekf", "estimators.filterpy_ekf"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(NotInstalledError, match=r"pip install 'fusion-localization\[filterpy\]'"):
        fusion.load(name)


@pytest.mark.parametrize("module", ["fusion.no_such_module", "json.no_such_module"])
def test_plugin_that_misses_a_module_of_a_package_that_is_there_is_broken(installed, module):
    installed(("wrong", f"{module}:Wrong"))
    with pytest.raises(PluginError, match=r"'wrong' .*cannot be imported") as caught:
        fusion.load("wrong")
    assert not isinstance(caught.value, NotInstalledError)


def test_what_is_not_available_is_left_out_and_reported_once_for_each_cause(stranger, monkeypatch, tmp_path):
    (tmp_path / "site" / "lacking.py").with_name("broken.py").write_text("1 / 0\n", encoding="utf-8")
    with (tmp_path / "site" / "stranger-1.dist-info" / "entry_points.txt").open("a", encoding="utf-8") as entries:
        entries.write("broken = broken:Broken\n")
    assert {"lacking_one", "lacking_two", "broken"} <= set(fusion.names())
    assert set(fusion.available()) == set(fusion.names()) - {"lacking_one", "lacking_two", "broken"}
    lacking, broken = left_out()
    assert lacking == f"lacking_one, lacking_two: {stranger}"
    assert "'broken' (broken:Broken of stranger) failed while being imported: ZeroDivisionError" in broken


def test_check_of_what_is_not_installed_is_one_sentence(stranger, capsys):
    assert main(["check", "lacking_one"]) == 1
    assert capsys.readouterr() == ("", f"fusion check: lacking_one: {stranger}\n")


def test_module_that_hides_a_package_is_refused_with_a_hint_to_rename(installed):
    installed(("hidden", "argparse.filters:Hidden"))
    with pytest.raises(PluginError, match=r"argparse\.py beside your script hides the package; rename it"):
        fusion.load("hidden")


def test_broken_plugin_is_listed_with_its_error_beside_the_others(installed, capsys):
    installed(("lost", "no_such_package.filters:Lost"))
    listing.run(argparse.Namespace(json=True))
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert "no_such_package" in rows["lost"]["error"]
    assert {"name": "gate_probability", "type": "float", "default": 0.999} in rows["ekf"]["parameters"]
    assert "error" not in rows["ekf"]


def test_plugin_that_is_no_estimator_is_listed_with_its_error(installed, capsys):
    installed(("number", "math:pi"))
    listing.run(argparse.Namespace(json=False))
    text = capsys.readouterr().out
    assert "number: cannot be used" in text
    assert "ekf: " in text


# --- the doors, by a distribution on the path that declares one entry point -------------------------------------------


BROKEN = {
    "does not compile": ("def", "failed while being imported: SyntaxError"),
    "fails": ("1 / 0", "failed while being imported: ZeroDivisionError"),
    "exits": ("import sys\nsys.exit(3)", "failed while being imported: SystemExit"),
    "lacks a name": ("", "has no attribute 'thing'"),
    "is no such thing": ("thing = 3.14", "is not an? "),
    "takes nothing": ("class thing: pass", "is not an? "),
}


@pytest.mark.parametrize("group", [fusion.plugins.ESTIMATORS, SENSORS, IMPORTERS, FAULTS])
@pytest.mark.parametrize("code", BROKEN)
def test_broken_plugin_is_refused_in_one_sentence_that_names_its_distribution(declare, group, code):
    declare(group, "odd", "visitor:thing", BROKEN[code][0])
    with pytest.raises(PluginError, match=BROKEN[code][1]) as caught:
        fusion.load("odd", group)
    assert "(visitor:thing of visitors)" in str(caught.value)
    assert "uninstall that" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert all(fusion.load(name, group) for name in fusion.built_in_names(group))


METHODS = " summary = ''\n def start(self): pass\n step = estimate = discover = open = poll = close = start\n"
WRONG = {
    "an estimator without world": (
        fusion.plugins.ESTIMATORS,
        f"class thing:\n{METHODS} tags = frozenset()\n def __init__(self): pass\n",
        "is not an estimator: it cannot be called with 1 argument by position;",
    ),
    "an estimator whose tags are no set": (
        fusion.plugins.ESTIMATORS,
        f"class thing:\n{METHODS} tags = ()\n",
        "is not an estimator: its tags is \\(\\), no Set;",
    ),
    "a driver without clock": (
        SENSORS,
        f"class thing:\n{METHODS} def __init__(self, name): pass\n",
        "is not a sensor: it cannot be called with 2 arguments by position;",
    ),
    "an importer without a folder": (
        IMPORTERS,
        "def thing(*, first, second): pass",
        "is not an importer: it cannot be called with 1 argument by position;",
    ),
    "a fault without random numbers": (
        FAULTS,
        "class thing:\n kind, place, lasts, __dataclass_fields__ = 'odd', '', (), {}\n def apply(self, c): pass\n",
        "is not a fault: its apply does not take 3 arguments by position;",
    ),
    "a fault of another name": (
        FAULTS,
        "class thing:\n kind, place, lasts, __dataclass_fields__ = 'even', '', (), {}\n def apply(self, c, r): pass\n",
        "is not a fault: its kind is 'even';",
    ),
    "a fault that lacks parts": (FAULTS, "class thing:\n kind = 'odd'\n", "it lacks apply, place, lasts"),
}


@pytest.mark.parametrize("case", WRONG)
def test_plugin_of_a_wrong_signature_is_refused(declare, case):
    group, code, sentence = WRONG[case]
    declare(group, "odd", "visitor:thing", code)
    with pytest.raises(PluginError, match=sentence):
        fusion.load("odd", group)


@pytest.mark.parametrize(
    ("group", "name"), [(fusion.plugins.ESTIMATORS, "ekf"), (SENSORS, "wifi"), (IMPORTERS, "csv"), (FAULTS, "drop")]
)
def test_name_of_ours_that_a_stranger_claims_is_refused_and_the_others_are_as_before(declare, group, name):
    declare(group, name, "visitor:thing", "")
    with pytest.raises(PluginError, match=f"'{name}' is claimed twice .*uninstall one of them") as caught:
        fusion.load(name, group)
    assert "visitor:thing of visitors" in str(caught.value)
    assert f" of {fusion.plugins.DISTRIBUTION}" in str(caught.value)
    other = next(one for one in fusion.built_in_names(group) if one != name)
    assert fusion.load(other, group)


@pytest.mark.parametrize("verb", [["estimators"], ["check", "odd"], ["bench", "none.mcap", "--estimators", "odd"]])
def test_commands_meet_something_that_is_no_estimator_without_a_traceback(declare, capsys, verb):
    declare(fusion.plugins.ESTIMATORS, "odd", "visitor:thing", "thing = 3.14")
    assert main(verb) == (0 if verb == ["estimators"] else 1)
    assert "'odd' (visitor:thing of visitors) is not an estimator: it lacks summary, tags" in "".join(
        capsys.readouterr()
    )


def test_annotations_that_mean_nothing_are_one_sentence(declare, capsys):
    code = f"class thing:\n{METHODS} tags = frozenset()\n def __init__(self, world, gain: 'No' = 0): pass\n"
    declare(fusion.plugins.ESTIMATORS, "odd", "visitor:thing", code)
    with pytest.raises(PluginError, match="cannot be read: NameError"):
        fusion.build("odd", fusion.World.from_table({"anchors": [{"id": "a", "position_m": [0, 0]}]}))
    assert main(["estimators"]) == 0
    assert "odd: cannot be used: the annotations of" in capsys.readouterr().out


def test_importer_that_answers_something_else_is_refused(declare, tmp_path, capsys):
    declare(IMPORTERS, "odd", "visitor:thing", "def thing(folder): return 7")
    assert main(["import", "odd", str(tmp_path), "-o", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.startswith("fusion import: the importer odd answered 7; it must answer")


def test_group_without_any_of_ours_asks_to_install_anew(monkeypatch):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [])
    with pytest.raises(PluginError, match="was installed before it declared any; install it anew"):
        fusion.load("drop", FAULTS)


GREET = """
def configure(parser):
    parser.add_argument("name")
def run(arguments):
    print("hello", arguments.name)
    return 0
"""


def test_verb_of_a_plugin_is_listed_and_runs_without_being_imported_for_the_list(declare, capsys):
    declare(VERBS, "greet", "visitor", "raise RuntimeError")
    assert main(["--help"]) == 0
    assert "  greet       Things brought along (visitors)\n" in capsys.readouterr().out
    declare(VERBS, "greet", "visitor", GREET)
    assert main(["greet", "you"]) == 0
    assert capsys.readouterr().out == "hello you\n"


VERB_CODE = {
    "fails": ("1 / 0", "failed while being imported: ZeroDivisionError"),
    "lacks parts": ("run = 1", "is not a verb: it lacks configure"),
    "takes too much": (GREET.replace("run(arguments)", "run(a, b)"), "its run does not take 1 argument by position"),
    "fails to configure": (GREET.replace("parser.add", "parser.ad"), "failed to add its arguments: AttributeError"),
    "answers no exit code": (GREET.replace("return 0", "return 'done'"), "run() answered 'done', no exit code"),
}


@pytest.mark.parametrize("case", VERB_CODE)
def test_broken_verb_is_one_sentence_and_ours_go_on(declare, capsys, case):
    code, sentence = VERB_CODE[case]
    declare(VERBS, "greet", "visitor", code)
    assert main(["greet", "you"]) == 1
    error = capsys.readouterr().err
    assert sentence in error
    assert error.startswith("fusion greet: ")
    assert error.count("\n") == 1
    assert main(["estimators", "--json"]) == 0


def test_verb_with_a_name_of_ours_is_left_out_with_a_sentence(declare, capsys):
    declare(VERBS, "estimators", "visitor", GREET)
    assert main(["--help"]) == 0
    assert "the verb 'estimators' of visitors is left out, fusion has one of that name" in capsys.readouterr().out
    assert main(["estimators", "--json"]) == 0
    assert "ekf" in capsys.readouterr().out


def test_unknown_verb_is_answered_with_the_nearest_of_a_plugin_too(declare, capsys):
    declare(VERBS, "greet", "visitor", GREET)
    assert main(["gret"]) == 2
    assert "did you mean 'greet'?" in capsys.readouterr().err
