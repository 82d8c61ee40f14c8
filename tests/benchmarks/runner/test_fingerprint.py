"""Stored results hold until code that decides numbers changes."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fusion
from benchmarks.runner.fingerprint import DECIDES_NOTHING, fingerprint

ROOT = Path(fusion.__file__).parents[1]
IN_BENCHMARKS = ("cli", "report", "review")
ROOMS = ("fusion", "logs", "sensors", "estimators", "benchmarks")
SUITE = """
[suite]
name = "small"
[[runs]]
id = "office"
scenario = "paper_office"
duration_s = 5.0
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[faults]]
id = "slippery"
apply = [{ kind = "slip", factor = 1.1 }]
"""


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the rooms beside a suite whose cells are all in the store."""
    folder = tmp_path_factory.mktemp("checkout")
    for room in ROOMS:
        shutil.copytree(ROOT / room, folder / room, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "suite.toml").write_text(SUITE, encoding="utf-8")
    bench(folder, "run", "--workers", "1")
    return folder


def bench(folder, verb, *more):
    """`fusion bench` of the copied checkout; answers what it prints."""
    command = [sys.executable, "-m", "fusion.cli.main", "bench", verb, "suite.toml", "--store", "store", *more]
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    return done.stdout


def cached_after_change(checkout, *paths):
    """How many of the two cells, one clean and one with a fault, still hold while ``paths`` are changed."""
    before = {path: path.read_bytes() for path in paths}
    try:
        for path, content in before.items():
            path.write_bytes(content + b"\n# changed\n")
        return json.loads(bench(checkout, "plan", "--json"))["cached"]
    finally:
        for path, content in before.items():
            path.write_bytes(content)


def test_change_of_what_decides_no_number_keeps_stored_results(checkout):
    folders = [*(one.replace(".", "/") for one in DECIDES_NOTHING), *(f"benchmarks/{one}" for one in IN_BENCHMARKS)]
    paths = [path for folder in folders for path in (checkout / folder).glob("*.py")]
    assert len(paths) > len(folders)
    assert cached_after_change(checkout, *paths) == 2


@pytest.mark.parametrize(
    ("changed", "cached"),
    [
        ("fusion/fold.py", 0),
        ("logs/prior.py", 0),
        ("estimators/dead_reckoning.py", 0),
        ("sensors/simulation/robot.py", 0),
        ("benchmarks/faults/motion_faults.py", 1),
    ],
)
def test_change_of_what_decides_numbers_asks_for_results_anew(checkout, changed, cached):
    assert cached_after_change(checkout, checkout / changed) == cached


def test_package_without_init_is_hashed_and_depends_on_its_files(tmp_path, monkeypatch):
    (tmp_path / "loose_parts").mkdir()
    source = tmp_path / "loose_parts" / "filters.py"
    source.write_text("GAIN = 1.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    first = fingerprint.__wrapped__("loose_parts.filters")
    assert fingerprint.__wrapped__("loose_parts.filters") == first
    source.write_text("GAIN = 2.0\n", encoding="utf-8")
    assert fingerprint.__wrapped__("loose_parts.filters") != first


def test_module_of_its_own_is_hashed_by_its_file(tmp_path, monkeypatch):
    (tmp_path / "lone_filter.py").write_text("GAIN = 1.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    first = fingerprint.__wrapped__("lone_filter")
    (tmp_path / "unrelated.py").write_text("", encoding="utf-8")
    assert fingerprint.__wrapped__("lone_filter") == first
    (tmp_path / "lone_filter.py").write_text("GAIN = 2.0\n", encoding="utf-8")
    assert fingerprint.__wrapped__("lone_filter") != first
