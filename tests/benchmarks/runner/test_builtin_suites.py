"""The suites that come with the package, and the catalogue of the recordings that do not."""

import hashlib
import sys
import tomllib
from pathlib import Path

import pytest

from benchmarks.runner import suite as definition
from benchmarks.runner.plan import estimator_identity, read_faults
from benchmarks.runner.suite import builtin_suites
from benchmarks.runner.suite_file import load_suite
from fusion import SuiteError, names
from fusion.cli.main import main
from fusion.plugins import IMPORTERS
from sensors.simulation.scenario import builtin_names

SUITES = Path(definition.__file__).parents[1] / "suites"
CATALOGUE = tomllib.loads((SUITES / "catalogue.toml").read_text(encoding="utf-8"))
DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data"


@pytest.mark.parametrize("name", ["quick", "paper", "synthetic", "real"])
def test_suite_loads_and_names_what_exists(name):
    suite = load_suite(SUITES / f"{name}.toml")
    assert suite.name == name
    for estimator in suite.estimators:
        estimator_identity(estimator)
    for faults in suite.faults:
        read_faults(faults)
    assert {run.scenario for run in suite.runs} <= {*builtin_names(), None}
    assert {run.catalogue for run in suite.runs} <= {*CATALOGUE, None}


def test_built_in_suites_go_by_name_and_a_near_miss_is_answered():
    assert sorted(builtin_suites()) == ["paper", "quick", "real", "synthetic"]
    assert load_suite(Path("quick")) == load_suite(SUITES / "quick.toml")
    with pytest.raises(SuiteError, match="did you mean 'quick'"):
        load_suite(Path("quikc"))


OPTIONAL = """
[suite]
name = "optional"
[[runs]]
id = "office"
scenario = "office"
duration_s = 6.0
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "theirs"
use = "lacking_one"
optional = true
[gate]
floor = { availability = 0.5 }
"""


@pytest.fixture
def optional(stranger, tmp_path):
    """Suite and store on a command line; one of its estimators is optional, and not installed."""
    (tmp_path / "optional.toml").write_text(OPTIONAL, encoding="utf-8")
    return [str(tmp_path / "optional.toml"), "--store", str(tmp_path / "store")]


def test_optional_estimator_that_is_not_installed_is_left_out_with_the_remedy(optional, stranger, tmp_path, capsys):
    assert main(["bench", "run", *optional, "-j", "1"]) == 0
    printed = capsys.readouterr()
    assert printed.err == f"fusion bench: lacking_one: {stranger}\nfusion bench run: 1 ok\n"
    assert "wheels" in printed.out
    assert "theirs" not in printed.out
    page = tmp_path / "page.md"
    assert main(["bench", "report", *optional, "--markdown", str(page)]) == 0
    assert f"Left out: lacking_one: {stranger}." in page.read_text(encoding="utf-8")


def test_gate_is_inconclusive_about_an_estimator_that_is_left_out(optional, stranger, tmp_path, capsys):
    assert main(["bench", "run", *optional, "-j", "1"]) == 0
    assert main(["bench", "gate", *optional]) == 4
    assert f"inconclusive: lacking_one: {stranger}" in capsys.readouterr().out
    path = Path(optional[0])
    path.write_text(OPTIONAL + 'inconclusive = "warn"\n', encoding="utf-8")
    assert main(["bench", "gate", *optional]) == 0


def test_suite_that_needs_what_is_not_installed_is_refused_by_name(optional, stranger, capsys):
    path = Path(optional[0])
    for text in (
        OPTIONAL.replace("optional = true", ""),
        OPTIONAL.replace('use = "dead_reckoning"', 'use = "lacking_one"'),
    ):
        path.write_text(text, encoding="utf-8")
        assert main(["bench", "run", *optional]) == 1
        assert f"fusion bench run: lacking_one: {stranger}" in capsys.readouterr().err
    path.write_text(OPTIONAL.replace('id = "wheels"\nuse = "dead_reckoning"\n[[estimators]]\n', ""), encoding="utf-8")
    assert main(["bench", "run", *optional]) == 1
    assert f"none of them is installed: lacking_one: {stranger}" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["quick", "paper", "synthetic", "real"])
def test_built_in_suite_does_without_packages_that_a_base_install_lacks(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "filterpy", None)
    for module in ("estimators.filterpy_ekf", "estimators.filterpy_ekf"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    suite = load_suite(Path(name))
    assert not [one.use for one in suite.estimators if one.use.startswith("filterpy")]
    for estimator in suite.estimators:
        estimator_identity(estimator)


def test_suites_have_enough_runs_for_a_verdict():
    assert len(load_suite(SUITES / "synthetic.toml").runs) >= 12
    assert len(load_suite(SUITES / "paper.toml").runs) >= 12
    assert len(load_suite(SUITES / "real.toml").runs) >= 12


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_catalogue_lists_where_a_set_comes_from_and_on_what_terms(name):
    entry = CATALOGUE[name]
    assert entry["importer"] in names(IMPORTERS)
    assert entry["address"].startswith("https://")
    assert len(entry["commit"]) == 40
    assert entry["licence"]
    assert entry["attribution"]


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_catalogue_names_the_bytes_that_were_tried(name):
    if not (DATA / name).is_dir():
        pytest.skip(f"the recordings of {name} are not here")
    for path, digest in CATALOGUE[name]["sha256"].items():
        assert hashlib.sha256((DATA / name / path).read_bytes()).hexdigest() == digest, path
