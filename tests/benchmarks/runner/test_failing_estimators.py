"""Estimators that fail, hang or die, met by the verbs that compute again what is there: they cost themselves alone."""

import json
from pathlib import Path

import pytest

from fusion.cli.main import main

SUITE = """
[suite]
name = "trouble"
limits = { wall_s = 4.0, rss_mb = 2000.0 }
[[runs]]
id = "office"
scenario = "office"
duration_s = 1.0
"""
PLUGIN = """
import os, sys, time
from estimators.dead_reckoning import DeadReckoning

class Hangs(DeadReckoning):
    def start(self, prior, seed):
        while not os.path.exists(os.environ.get("TROUBLE_IS_OVER", "")): time.sleep(0.02)
        return super().start(prior, seed)

class Leaves(DeadReckoning):
    def start(self, prior, seed): os._exit(0)

class Quits(DeadReckoning):
    def start(self, prior, seed): sys.exit(0)

class Fails(DeadReckoning):
    def start(self, prior, seed): raise RuntimeError("no luck")
"""
NAMES = ("hangs", "leaves", "quits", "fails")


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """A suite of a stranger's estimators, and one of ours behind them; its words on a command line."""
    site, folder = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("suite")
    (site / "trouble_plugin.py").write_text(PLUGIN, encoding="utf-8")
    (site / "trouble_plugin-1.dist-info").mkdir()
    (site / "trouble_plugin-1.dist-info" / "METADATA").write_text(
        "Name: trouble_plugin\nVersion: 1\n", encoding="utf-8"
    )
    entries = "".join(f"{name} = trouble_plugin:{name.capitalize()}\n" for name in NAMES)
    (site / "trouble_plugin-1.dist-info" / "entry_points.txt").write_text(f"[fusion.estimators]\n{entries}")
    estimators = [f'[[estimators]]\nid = "{name}"\nuse = "{name}"\n' for name in (*NAMES, "dead_reckoning")]
    (folder / "suite.toml").write_text(SUITE + "".join(estimators), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(site)
        words = [str(folder / "suite.toml"), "--store", str(folder / "store")]
        assert main(["bench", "run", *words, "-j", "2"]) == 0
        yield words


def test_verify_comes_to_its_end(suite, capsys):
    assert main(["bench", "verify", *suite, "--sample", "9"]) == 0
    assert "every sampled cell is the same" in capsys.readouterr().out


def test_time_names_who_has_none_and_why(suite, capsys):
    assert main(["bench", "time", *suite, "--repeats", "1"]) == 0
    printed = capsys.readouterr()
    assert "dead_reckoning" in printed.out
    for name, why in zip(NAMES, ("longer than limits.wall_s", "died", "died", "no luck"), strict=True):
        (line,) = [line for line in printed.err.splitlines() if f" {name} has no time" in line]
        assert why in line
    with open(f"{suite[-1]}/timing.json", encoding="utf-8") as stream:
        assert [row["estimator"] for row in json.load(stream)["untimed"]] == list(NAMES)


def statuses(words, capsys):
    capsys.readouterr()
    assert main(["bench", "export", *words, "--json", "-"]) == 0
    return {row["estimator"]: row["status"] for row in json.loads(capsys.readouterr().out)["results"]}


def test_cell_that_broke_a_limit_is_tried_again_when_that_is_greater(suite, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("TROUBLE_IS_OVER", str(tmp_path))
    assert main(["bench", "run", *suite, "-j", "1"]) == 0
    assert statuses(suite, capsys)["hangs"] == "timeout"
    text = Path(suite[0]).read_text(encoding="utf-8")
    (tmp_path / "suite.toml").write_text(text.replace("wall_s = 4.0", "wall_s = 60.0"), encoding="utf-8")
    patient = [str(tmp_path / "suite.toml"), *suite[1:]]
    assert main(["bench", "plan", *patient]) == 0
    assert "4 cached, 1 to compute" in capsys.readouterr().out
    assert main(["bench", "run", *patient, "-j", "1"]) == 0
    assert statuses(patient, capsys) == {**dict.fromkeys(NAMES, "crashed"), "hangs": "ok", "dead_reckoning": "ok"}
