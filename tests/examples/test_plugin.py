"""A distribution that brings one plug-in of every kind, installed into a fresh environment and used by every verb."""

import csv
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from fusion import plugins

EXAMPLE = Path(__file__).parents[2] / "examples" / "plugin"
WORLD = """
[[anchors]]
id = "a"
position_m = [0.0, 0.0]
[[anchors]]
id = "b"
position_m = [6.0, 0.0]
[[anchors]]
id = "c"
position_m = [0.0, 6.0]
"""
SUITE = """
[suite]
name = "rounded"
[[runs]]
id = "line"
mcap = "run.mcap"
[[estimators]]
id = "walk"
use = "random_walk"
[[faults]]
id = "none"
[[faults]]
id = "rounded"
apply = [{ kind = "quantise", topic = "ranges", step = 2.0 }]
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """An environment that sees what this one has installed, and the example beside it."""
    folder = tmp_path_factory.mktemp("plugin")
    venv.create(folder / "venv", with_pip=False)
    python = folder / "venv" / "bin" / "python"
    own = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    Path(own, "host.pth").write_text(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})\n")
    shutil.copytree(EXAMPLE, folder / "source")
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--no-deps", "--no-build-isolation", "--no-index", folder / "source"], check=True)
    return python


@pytest.fixture(scope="module")
def fusion(environment, tmp_path_factory):
    """A command line in that environment: answers its standard output."""
    folder = tmp_path_factory.mktemp("work")

    def run(*arguments):
        program = "import sys; from fusion.cli.main import main; sys.exit(main())"
        done = subprocess.run(
            [environment, "-c", program, *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": ""},
        )
        assert done.returncode == 0, done.stderr
        assert "left out" not in done.stderr
        return done.stdout

    run.folder = folder
    return run


@pytest.fixture(scope="module")
def log(fusion):
    """A drive along a line, brought in by the example's importer."""
    source = fusion.folder / "drive"
    source.mkdir()
    (source / "world.toml").write_text(WORLD)
    rows = []
    for step in range(1, 101):
        time, x = 0.1 * step, 1.0 + 0.02 * step
        rows.append(f"odometry {time:.3f} {time - 0.1:.3f} 0.02 0.0")
        rows.append(f"truth {time:.3f} {x:.3f} 2.0 0.0")
        for anchor, (left, below) in {"a": (0, 0), "b": (6, 0), "c": (0, 6)}.items():
            rows.append(f"range {time:.3f} {anchor} {((x - left) ** 2 + (2.0 - below) ** 2) ** 0.5:.3f}")
    (source / "run.txt").write_text("\n".join(rows))
    fusion("import", "text", source, "-o", "run.mcap")
    return fusion.folder / "run.mcap"


def test_estimator_keeps_its_promises(fusion):
    assert "random_walk" in fusion("estimators")
    assert ", 0 broken" in fusion("check", "random_walk")


def test_driver_keeps_its_promises(fusion):
    assert "gyro_file" in fusion("sensors")
    assert ", 0 broken" in fusion("check", "--driver", "gyro_file")


def test_verb_reads_what_the_importer_brought_in(fusion, log):
    assert fusion("anchors", log) == "a: 0.00, 0.00, 0.00 m\nb: 6.00, 0.00, 0.00 m\nc: 0.00, 6.00, 0.00 m\n"
    assert "One plug-in of every kind" in fusion("--help")


def test_metric_stands_among_ours(fusion, log):
    random_walk, ekf = json.loads(fusion("bench", log, "--estimators", "random_walk,ekf", "--json", "-"))
    assert (random_walk["far_share"], ekf["far_share"]) == (0.0, 0.0)
    assert random_walk["pos_rmse"] < 0.1


def test_fault_acts_in_a_suite(fusion, log):
    (log.parent / "suite.toml").write_text(SUITE)
    fusion("bench", "run", "suite.toml", "--store", "store")
    table = csv.DictReader(fusion("bench", "export", "suite.toml", "--store", "store", "--csv", "-").splitlines())
    error_m = {cell["fault"]: float(cell["pos_rmse"]) for cell in table}
    assert error_m["none"] < 0.1 < error_m["rounded"]


def test_the_page_prints_the_estimator():
    page = (EXAMPLE.parents[1] / "docs" / "plugin.md").read_text(encoding="utf-8")
    assert f"```python\n{(EXAMPLE / 'fusion_example' / 'random_walk.py').read_text(encoding='utf-8')}```" in page


def test_every_kind_of_plugin_has_an_example():
    groups = {value for name, value in vars(plugins).items() if name.isupper() and str(value).startswith("fusion.")}
    declared = (EXAMPLE / "pyproject.toml").read_text(encoding="utf-8")
    assert len(groups) == 6
    assert all(f'[project.entry-points."{group}"]' in declared for group in groups)
