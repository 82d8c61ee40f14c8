"""The suites that come with the package, and the catalogue of the recordings that do not."""

import hashlib
import tomllib
from pathlib import Path

import pytest

from benchmarks.runner import definition
from benchmarks.runner.definition import builtin_suites, load_suite
from benchmarks.runner.plan import contestant_spec, read_faults
from fusion import SuiteError
from logs.importing import KINDS
from sensors.simulation.scenario import builtin_names

SUITES = Path(definition.__file__).parents[1] / "suites"
CATALOGUE = tomllib.loads((SUITES / "catalogue.toml").read_text(encoding="utf-8"))
DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data"


@pytest.mark.parametrize("name", ["quick", "paper", "synthetic", "real"])
def test_suite_loads_and_names_what_exists(name):
    suite = load_suite(SUITES / f"{name}.toml")
    assert suite.name == name
    for contestant in suite.contestants:
        contestant_spec(contestant)
    for faults in suite.faults:
        read_faults(faults)
    assert {run.scenario for run in suite.runs} <= {*builtin_names(), None}
    assert {run.catalogue for run in suite.runs} <= {*CATALOGUE, None}


def test_built_in_suites_go_by_name_and_a_near_miss_is_answered():
    assert sorted(builtin_suites()) == ["paper", "quick", "real", "synthetic"]
    assert load_suite(Path("quick")) == load_suite(SUITES / "quick.toml")
    with pytest.raises(SuiteError, match="did you mean 'quick'"):
        load_suite(Path("quikc"))


def test_suites_have_enough_runs_for_a_verdict():
    assert len(load_suite(SUITES / "synthetic.toml").runs) >= 12
    assert len(load_suite(SUITES / "paper.toml").runs) >= 12
    assert len(load_suite(SUITES / "real.toml").runs) >= 12


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_catalogue_tells_where_a_set_comes_from_and_on_what_terms(name):
    entry = CATALOGUE[name]
    assert entry["importer"] in KINDS
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
