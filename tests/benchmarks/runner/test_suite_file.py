"""A suite file is checked whole before any work, and refused with the place of the error."""

import pytest

from benchmarks.runner.suite import CLEAN
from benchmarks.runner.suite_file import load_suite
from fusion import SuiteError

SUITE = """
[suite]
name = "two"
seeds = 2
[[runs]]
id = "hall"
scenario = "paper_office"
[[estimators]]
id = "ekf"
use = "ekf"
"""


def written(tmp_path, text):
    path = tmp_path / "suite.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_smallest_suite_has_defaults_and_the_clean_fault(tmp_path):
    suite = load_suite(written(tmp_path, SUITE))
    assert (suite.name, suite.seed, suite.seeds) == ("two", 0, 2)
    assert [fault.id for fault in suite.faults] == [CLEAN]
    assert suite.evaluation.max_age_s == 1.0
    assert suite.folder == tmp_path.resolve()


def test_grid_is_spread_into_estimators_with_their_own_ids(tmp_path):
    grid = 'params = { bias_std_m = 0.1 }\ngrid = { gate_probability = [0.9, 0.99], scale = ["a", "b"] }\n'
    suite = load_suite(written(tmp_path, SUITE + grid))
    assert [one.id for one in suite.estimators] == [
        f"ekf[gate_probability={gate},scale={scale}]" for gate in (0.9, 0.99) for scale in "ab"
    ]
    assert suite.estimators[0].params == {"bias_std_m": 0.1, "gate_probability": 0.9, "scale": "a"}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('[[runs]]\nid = "hall"\nmcap = "a.mcap"', "the id 'hall' is given twice"),
        ('[[runs]]\nid = "b"', "give either mcap, a log, or scenario"),
        ('[[runs]]\nid = "b"\nmcap = "a.mcap"\nscenario = "office"', "give either mcap, a log, or scenario"),
        ('[[runs]]\nid = "b"\nmcap = "a"\nsplit = "tets"', "did you mean 'test'"),
        ('[[runs]]\nid = "b"\nmcpa = "a"', "did you mean 'mcap'"),
        ('[[estimators]]\nid = "pf"\nuse = "particle"\ntuned_on = ["hall"]', "was tuned on hall, which is a test run"),
        ('[[estimators]]\nid = "pf"\nuse = "particle"\ntuned_on = ["hlal"]', "did you mean 'hall'"),
        ('[[faults]]\nid = "clean"', "the id 'clean' is given twice"),
        ("[gates]", "did you mean 'gate'"),
        ('[gate]\nratio = { pos_p75 = "small" }', "gate.ratio.pos_p75: expected float"),
        ('[gate]\ninconclusive = "wran"', "did you mean 'warn'"),
        (
            '[[runs]]\nid = "b"\nscenario = "office"\nduration_s = -1.0',
            r"runs\[1\] \(b\).duration_s: -1 is not above 0",
        ),
        ('[[estimators]]\nid = "pf"\nuse = "particle"\ngrid = { particles = [] }', "pf: grid.particles is empty"),
        ('[[runs]]\nid = "b"\nscenario = "office"\nseed = -3', r"runs\[1\] \(b\).seed: -3 is below 0"),
        ('[[runs]]\nid = "b"\nmcap = "b.mcap"\nduration_s = 5.0', "a log is taken whole"),
        ('[[runs]]\nid = "b"\nmcap = "b.mcap"\nseed = 1', "a log is taken whole"),
        ('[[runs]]\nid = "b"\nmcap = "b.mcap"\ntruth_to_map = [1.0, 0.0, 0.0]', "truth_to_map is of a foreign bag"),
        ('[[runs]]\nid = ""\nscenario = "office"', r"runs\[1\]: the id is empty"),
        ('[[estimators]]\nid = "e"\nuse = "ekf"\nparams = { gate_probability = nan }', "gate_probability is nan"),
        ('[[estimators]]\nid = "e"\nuse = "ekf"\ngrid = { gate_probability = [0.9, inf] }', "gate_probability is inf"),
        ("x = [", "not TOML"),
    ],
)
def test_wrong_suite_is_refused_with_the_place(tmp_path, more, message):
    with pytest.raises(SuiteError, match=message) as refusal:
        load_suite(written(tmp_path, SUITE + more))
    assert "suite.toml" in str(refusal.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("seeds = 0", "0 seeds from seed 0"),
        ('seeds = 2\neval = { reading = "casual" }', "did you mean 'causal'"),
        ("seeds = 2\nlimits = { wall = 3 }", "did you mean 'wall_s'"),
        ("seeds = 2\nlimits = { wall_s = 0.0 }", "limits.wall_s: 0 is not above 0"),
        ("seeds = 2\nlimits = { rss_mb = -1 }", "limits.rss_mb: -1 is not above 0"),
        ("seeds = 2\neval = { hz = 0 }", "eval.hz: 0 is not above 0"),
        ("seeds = 2\neval = { max_age_s = -0.5 }", "eval.max_age_s: -0.5 is not above 0"),
        ("seeds = 2\neval = { gap_s = 0.0 }", "eval.gap_s: 0 is not above 0"),
    ],
)
def test_wrong_head_is_refused(tmp_path, line, message):
    with pytest.raises(SuiteError, match=message):
        load_suite(written(tmp_path, SUITE.replace("seeds = 2", line)))


def test_parameters_tuned_on_a_tune_run_may_be_judged_on_another(tmp_path):
    more = '[[runs]]\nid = "b"\nscenario = "office"\nsplit = "tune"\n'
    more += '[[estimators]]\nid = "pf"\nuse = "particle"\ntuned_on = ["b"]\n'
    assert load_suite(written(tmp_path, SUITE + more)).estimators[1].tuned_on == ("b",)


def test_missing_suite_is_reported(tmp_path):
    with pytest.raises(SuiteError, match="cannot be read"):
        load_suite(tmp_path / "none.toml")
