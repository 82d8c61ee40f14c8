"""Plug-ins that cannot be brought in say why, and none hides the others."""

import argparse
import importlib.metadata
import json
from importlib.metadata import EntryPoint

import pytest

import fusion
from fusion import PluginError, listing

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


def test_plugin_whose_package_is_missing_says_what_to_install(installed):
    installed(("lost", "no_such_package.filters:Lost"))
    with pytest.raises(PluginError, match=r"'lost' .*cannot be imported: No module named 'no_such_package'.*install"):
        fusion.load("lost")


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
