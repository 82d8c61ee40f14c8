"""What holds for all tests."""

import importlib
import os
import sys

import pytest
from hypothesis import settings

# Before NumPy is there: its threads wait for one another by spinning, which costs a core that other tests want.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# A deadline measures the machine's load, not the code; speed is measured elsewhere.
settings.register_profile("fusion", deadline=None, derandomize=True)
settings.load_profile("fusion")

METADATA = """Name: stranger
Version: 1
Requires-Dist: no-such_package>=2; extra == "all"
Requires-Dist: another; extra == 'all'
Requires-Dist: no-such_package>=2 ; extra == 'tiny'
"""
REMEDY = "not installed, the package no_such_package is missing; pip install 'stranger[tiny]'"


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    """A distribution whose estimators `lacking_one` and `lacking_two` need a missing package; answers the remedy."""
    site = tmp_path / "site"
    about = site / "stranger-1.dist-info"
    about.mkdir(parents=True)
    (site / "lacking.py").write_text("import no_such_package.filters\n", encoding="utf-8")
    (about / "METADATA").write_text(METADATA, encoding="utf-8")
    entries = "[fusion.estimators]\nlacking_one = lacking:One\nlacking_two = lacking:Two\n"
    (about / "entry_points.txt").write_text(entries, encoding="utf-8")
    monkeypatch.syspath_prepend(site)
    return REMEDY


@pytest.fixture
def declare(tmp_path, monkeypatch):
    """Puts a module ``visitor`` on the path, of a distribution `visitors` that declares ``name`` in ``group``."""
    site = tmp_path / "visitors"
    about = site / "visitors-1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Name: visitors\nVersion: 1\nSummary: Things brought along\n", encoding="utf-8")
    monkeypatch.syspath_prepend(site)

    def put(group, name, value, code):
        (site / "visitor.py").write_text(code, encoding="utf-8")
        (about / "entry_points.txt").write_text(f"[{group}]\n{name} = {value}\n", encoding="utf-8")
        monkeypatch.delitem(sys.modules, "visitor", raising=False)
        importlib.invalidate_caches()

    yield put
    sys.modules.pop("visitor", None)
