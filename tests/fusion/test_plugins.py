"""Plug-ins that cannot be brought in say why, and none hides the others."""

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
from fusion.plugins import left_out

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
    assert "'broken' (broken:Broken) failed while being imported: ZeroDivisionError" in broken


def test_check_of_what_is_not_installed_is_one_sentence(stranger, capsys):
    assert main(["check", "lacking_one"]) == 1
    assert capsys.readouterr() == ("", f"fusion check: lacking_one: {stranger}\n")


def test_module_that_hides_a_package_is_told_to_be_renamed(installed):
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
