"""What is asked of stored results: comparisons, the gate with its exit codes, verification, exports."""

import csv
import json
import math
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks.cli.suite_arguments import stored_results
from benchmarks.metrics.score import METRICS_VERSION
from benchmarks.runner.export import as_junit, as_latex
from benchmarks.runner.gate import Outcome, judge, read_baseline
from benchmarks.runner.plan import cells_of
from benchmarks.runner.results import comparison, flat, score_matrix
from benchmarks.runner.run_suite import run_suite
from benchmarks.runner.store import Store
from benchmarks.runner.suite import EstimatorSpec, FaultSet, Gate, RunSource
from benchmarks.runner.suite_file import load_suite
from benchmarks.runner.timing import measure
from benchmarks.runner.verify import differing
from benchmarks.runner.workers import Limits
from fusion.cli.main import main
from fusion.output.tables import Table
from tests.benchmarks.suite_files import write_suite

HEAD = '[suite]\nname = "verbs"\n'
RUNS = "".join(
    f'[[runs]]\nid = "run{seed}"\nscenario = "paper_mec"\nseed = {seed}\nduration_s = 60.0\n' for seed in range(8)
)
TAIL = """
[[estimators]]
id = "wheels"
use = "dead_reckoning"
[[estimators]]
id = "radio"
use = "radio_only"
[gate]
ratio = { pos_p75 = 0.05 }
floor = { availability = 0.99 }
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("verbs")
    suite = write_suite(folder, HEAD + RUNS + TAIL)
    run_suite(suite, Store(folder / "store"), workers=1)
    return folder


@pytest.fixture(scope="module")
def results(place):
    from argparse import Namespace

    return stored_results(Namespace(suite=place / "suite.toml", store=place / "store"))[1]


def words(place, verb, *more):
    return ["bench", verb, str(place / "suite.toml"), "--store", str(place / "store"), *more]


def scaled(results, estimator, factors):
    """The results with one estimator's p75 multiplied, run by run."""
    return [
        result._replace(metrics={**result.metrics, "pos_p75": factors[k % 8] * result.metrics["pos_p75"]})
        if result.cell.estimator.id == estimator
        else result
        for k, result in ((int(result.cell.run.id.removeprefix("run")), result) for result in results)
    ]


def baseline_of(results):
    rows = json.loads(json.dumps([flat(result) for result in results]))
    return {name: [row for row in rows if row["estimator"] == name] for name in ("wheels", "radio")}


def test_matrix_has_one_row_a_run_and_infinity_where_a_run_was_lost(results):
    own = [result for result in results if result.cell.estimator.id == "wheels"]
    assert score_matrix(own, "pos_p75").shape == (8, 1)
    assert np.isinf(score_matrix(own, "no_such_metric")).all()


def test_compare_states_in_a_sentence_who_is_better_or_that_it_is_inconclusive(place, results, capsys):
    assert main(words(place, "compare")) == 0
    printed = capsys.readouterr().out
    (verdict,) = comparison(results).verdicts
    assert printed.startswith(verdict.sentence)
    assert "ratio [95 %]" in printed


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["wheelz"], "did you mean 'wheels'"),
        (["--metric", "pos_p755"], "did you mean 'pos_p75'"),
        (["--fault", "claen"], "did you mean 'clean'"),
        (["--metric", "availability"], "a lower availability is not better"),
        (["--metric", "anees"], "a lower anees is not better"),
        (["wheels"], "name two or more"),
        (["wheels", "wheels"], "name two or more"),
    ],
)
def test_compare_refuses_what_the_suite_does_not_have(place, more, message, capsys):
    assert main(words(place, "compare", *more)) == 1
    assert message in capsys.readouterr().err


def outcomes(findings):
    return {finding.outcome for finding in findings}


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        pytest.param([1.0] * 8, Outcome.PASS, id="unchanged"),
        pytest.param([0.8] * 8, Outcome.PASS, id="better everywhere"),
        pytest.param([1.03, 1.02, 1.01, 1.02, 1.03, 1.01, 1.02, 1.03], Outcome.PASS, id="worse within the margin"),
        pytest.param([1.2, 1.3, 1.25, 1.2, 1.3, 1.2, 1.25, 1.3], Outcome.REGRESSION, id="clearly worse"),
        pytest.param([0.7, 1.5, 0.8, 1.4, 0.9, 1.3, 0.75, 1.6], Outcome.INCONCLUSIVE, id="now better, now worse"),
    ],
)
def test_gate_judges_the_whole_interval_against_the_margin(results, factors, expected):
    findings = judge(scaled(results, "wheels", factors), Gate(ratio={"pos_p75": 0.05}), baseline_of(results))
    assert outcomes(findings) == {expected, Outcome.PASS}


def test_gate_holds_the_worst_cell_against_a_floor(results):
    assert outcomes(judge(results, Gate(floor={"availability": 0.99}), None)) == {Outcome.PASS}
    spoilt = [results[0]._replace(metrics={**results[0].metrics, "availability": 0.5}), *results[1:]]
    assert Outcome.REGRESSION in outcomes(judge(spoilt, Gate(floor={"availability": 0.99}), None))


@pytest.mark.parametrize(
    ("anees", "expected"),
    [(1.0, Outcome.PASS), (3.0, Outcome.REGRESSION), (0.1, Outcome.REGRESSION), (float("nan"), Outcome.INCONCLUSIVE)],
)
def test_gate_holds_every_cell_inside_its_own_band(results, anees, expected):
    band = {"anees": 1.0, "anees_band_low": 0.5, "anees_band_high": 1.8}
    honest = [result._replace(metrics={**result.metrics, **band}) for result in results]
    one = honest[0]._replace(metrics={**honest[0].metrics, "anees": anees})
    assert outcomes(judge([one, *honest[1:]], Gate(inside=("anees",)), None)) == {expected, Outcome.PASS}


def test_a_cell_that_is_lost_now_and_was_not_before_is_a_regression(results):
    lost = [results[0]._replace(status="crashed"), *results[1:]]
    assert outcomes(judge(lost, Gate(), baseline_of(results))) == {Outcome.REGRESSION}
    assert judge(lost, Gate(), baseline_of(lost)) == []


def test_estimator_that_the_baseline_does_not_know_is_inconclusive(results):
    known = {"wheels": baseline_of(results)["wheels"]}
    assert Outcome.INCONCLUSIVE in outcomes(judge(results, Gate(ratio={"pos_p75": 0.05}), known))


def test_gate_pairs_with_its_baseline_by_run_not_by_row(results):
    gate, before = Gate(ratio={"pos_p75": 0.05}), baseline_of(results)
    backwards = {name: rows[::-1] for name, rows in before.items()}
    assert outcomes(judge(results, gate, backwards)) == {Outcome.PASS}
    elsewhere = {
        name: [{**row, "run": f"{row['run']}-of-another-hall"} for row in rows] for name, rows in before.items()
    }
    assert outcomes(judge(results, gate, elsewhere)) == {Outcome.INCONCLUSIVE}
    shorter = [result for result in results if result.cell.run.id != "run3"]
    assert outcomes(judge(shorter, gate, before)) == {Outcome.INCONCLUSIVE}
    tuned = {name: [*rows, {**rows[0], "run": "tuning", "split": "tune"}] for name, rows in before.items()}
    assert outcomes(judge(results, gate, tuned)) == {Outcome.PASS}


def test_run_whose_score_became_infinite_is_a_regression(results):
    found = judge(scaled(results, "wheels", [1.0] * 7 + [np.inf]), Gate(ratio={"pos_p75": 0.05}), baseline_of(results))
    assert [one.outcome for one in found] == [Outcome.REGRESSION, Outcome.PASS]
    assert "1 of 8 runs" in found[0].text


def test_scores_of_zero_have_no_ratio(results):
    found = judge(scaled(results, "wheels", [0.0] * 8), Gate(ratio={"pos_p75": 0.05}), baseline_of(results))
    assert [one.outcome for one in found] == [Outcome.USAGE, Outcome.PASS]


@pytest.mark.parametrize("silent", [0, -1])
def test_cell_without_a_value_hides_behind_no_other(results, silent):
    spoilt = list(results)
    spoilt[silent] = results[silent]._replace(metrics={**results[silent].metrics, "availability": math.nan})
    assert Outcome.INCONCLUSIVE in outcomes(judge(spoilt, Gate(floor={"availability": 0.9}), None))
    spoilt[silent] = spoilt[silent]._replace(status="crashed")
    assert Outcome.REGRESSION in outcomes(judge(spoilt, Gate(floor={"availability": 0.9}), None))


def test_gate_that_asks_for_a_ratio_does_not_pass_without_a_baseline(place, capsys):
    assert main(words(place, "gate")) == Outcome.NOT_MEASURED
    assert "give --baseline" in capsys.readouterr().out


def test_gate_limits_the_growth_of_nothing_that_should_grow(place, tmp_path, capsys):
    text = (place / "suite.toml").read_text(encoding="utf-8").replace("pos_p75 = 0.05", "availability = 0.05")
    (tmp_path / "suite.toml").write_text(text, encoding="utf-8")
    assert main(["bench", "gate", str(tmp_path / "suite.toml"), "--store", str(place / "store")]) == Outcome.USAGE
    assert "give it a floor" in capsys.readouterr().out


@pytest.mark.parametrize("spoil", [{"pos_p75": "high"}, {"pos_p75": math.nan}, {"pos_p75": True}, "twice"])
def test_rows_of_a_baseline_that_make_no_sense_are_reported(place, results, spoil, tmp_path, capsys):
    rows = [flat(result) for result in results]
    rows = [*rows, rows[0]] if spoil == "twice" else [{**rows[0], **spoil}, *rows[1:]]
    path = tmp_path / "base.json"
    path.write_text(json.dumps({"metrics_version": METRICS_VERSION, "results": rows}), encoding="utf-8")
    assert main(words(place, "gate", "--baseline", str(path))) == Outcome.USAGE
    assert "baseline" in capsys.readouterr().out


def test_gate_answers_with_the_exit_code_of_its_gravest_finding(place, tmp_path, capsys):
    assert main(words(place, "export", "--json", str(tmp_path / "base.json"))) == 0
    gate = words(place, "gate", "--baseline", str(tmp_path / "base.json"))
    assert main(gate) == Outcome.PASS
    assert main([*gate, "--verify", "3"]) == Outcome.PASS
    stored = json.loads((tmp_path / "base.json").read_text())
    for row in stored["results"]:
        row["pos_p75"] /= 2.0
    (tmp_path / "base.json").write_text(json.dumps(stored))
    assert main(gate) == Outcome.REGRESSION
    assert main(words(place, "gate", "--baseline", str(tmp_path / "none.json"))) == Outcome.USAGE
    empty = ["bench", "gate", str(place / "suite.toml"), "--store", str(tmp_path / "empty")]
    assert main(empty) == Outcome.NOT_MEASURED
    assert "not measured: 0 of 16 cells are there" in capsys.readouterr().out


def test_gate_for_a_metric_that_no_cell_has_never_passes(place, results, tmp_path, capsys):
    """A misspelt metric is infinite in every cell, now and before: that used to be "what it was"."""
    misspelt = tmp_path / "suite.toml"
    misspelt.write_text((HEAD + RUNS + TAIL).replace("pos_p75 =", "pos_p755 ="))
    assert main(words(place, "export", "--json", str(tmp_path / "base.json"))) == 0
    asked = ["bench", "gate", str(misspelt), "--store", str(place / "store"), "--baseline", str(tmp_path / "base.json")]
    assert main(asked) == Outcome.USAGE
    assert "no metric 'pos_p755'; did you mean 'pos_p75'?" in capsys.readouterr().out


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"\x89MCAP0\r\n" * 1000, id="a log"),
        pytest.param(b"[1]", id="a list"),
        pytest.param(json.dumps({"metrics_version": METRICS_VERSION, "results": [{}]}).encode(), id="a row of nothing"),
        pytest.param(json.dumps({"metrics_version": METRICS_VERSION, "results": 3}).encode(), id="no rows"),
    ],
)
def test_file_that_is_no_baseline_is_reported_in_a_line(place, tmp_path, content, capsys):
    (tmp_path / "base").write_bytes(content)
    assert main(words(place, "gate", "--baseline", str(tmp_path / "base"))) == Outcome.USAGE
    printed = capsys.readouterr().out
    assert "no baseline (" in printed
    assert len(printed) < 300


@pytest.mark.parametrize("more", [["gate", "--verify", "-3"], ["verify", "--sample", "0"]])
def test_no_cell_at_all_is_no_sample(place, more, capsys):
    with pytest.raises(SystemExit) as refusal:
        main(words(place, *more))
    assert refusal.value.code == Outcome.USAGE
    assert "give a whole number from 1 on" in capsys.readouterr().err


def test_export_of_nothing_is_refused(place, capsys):
    assert main(words(place, "export")) == 1
    assert "give at least one of --json, --csv" in capsys.readouterr().err


def test_baseline_of_other_metrics_is_refused(place, tmp_path, capsys):
    path = tmp_path / "old.json"
    path.write_text('{"results": [], "metrics_version": 0}')
    assert main(words(place, "gate", "--baseline", str(path))) == Outcome.USAGE
    assert "write the baseline anew" in capsys.readouterr().out


def test_verify_finds_the_cell_that_was_tampered_with(place, tmp_path, capsys):
    suite, store = load_suite(place / "suite.toml"), Store(tmp_path / "store")
    cut = replace(suite, runs=suite.runs[:1])
    assert main(["bench", "verify", str(place / "suite.toml"), "--store", str(store.folder)]) == 3
    run_suite(cut, store, workers=1)
    cells = cells_of(cut, store)
    assert differing(cells, store, 10, Limits()) == []
    track = store.place("estimates", cells[1].estimate_key) / "track.npz"
    track.write_bytes((store.place("estimates", cells[0].estimate_key) / "track.npz").read_bytes())
    assert [str(cell) for cell in differing(cells, store, 10, Limits())] == [str(cells[1])]
    assert main(["bench", "verify", str(place / "suite.toml"), "--store", str(store.folder)]) == 5
    assert "it differs" in capsys.readouterr().out


def test_exports_hold_every_cell(place, results, tmp_path, capsys):
    kinds = ("json", "csv", "latex", "markdown", "junit")
    files = {kind: tmp_path / f"out.{kind}" for kind in kinds}
    assert main(words(place, "export", *(word for kind in kinds for word in (f"--{kind}", str(files[kind]))))) == 0
    assert len(json.loads(files["json"].read_text())["results"]) == len(results) == 16
    rows = list(csv.DictReader(files["csv"].read_text().splitlines()))
    assert [float(row["pos_p75"]) for row in rows] == [result.metrics["pos_p75"] for result in results]
    assert files["latex"].read_text().count(r"\\") == 3
    assert files["markdown"].read_text().count("| ") >= 3
    suite = ElementTree.fromstring(files["junit"].read_text())
    assert (suite.get("tests"), suite.get("failures")) == ("16", "0")
    assert len(suite.findall("testcase")) == 16
    assert read_baseline(files["json"]).keys() == {"wheels", "radio"}


def test_verbs_refuse_a_suite_that_is_not_done(place, tmp_path, capsys):
    for verb in ("compare", "export"):
        assert main(["bench", verb, str(place / "suite.toml"), "--store", str(tmp_path / "none")]) == 1
        assert "0 of 16 cells are there; run `fusion bench run` first" in capsys.readouterr().err


def test_peak_memory_is_that_of_the_estimator_in_a_process_of_its_own(tmp_path):
    """300 000 particles are three columns of 2.4 MB at the least; what this process holds is not counted."""
    held = np.ones(50_000_000)
    path = tmp_path / "suite.toml"
    particles = [
        f'[[estimators]]\nid = "{n}"\nuse = "particle"\nparams = {{ particles = {n} }}\n' for n in (10, 300_000)
    ]
    path.write_text(
        '[suite]\nname = "t"\n[[runs]]\nid = "a"\nscenario = "office"\nduration_s = 1.0\n' + "".join(particles)
    )
    few, many = (timing.rss_mb for timing in measure(load_suite(path), repeats=1))
    assert 10.0 < few < held.nbytes / 2**20
    assert many > few + 3 * 2.4e6 / 2**20


def test_error_of_an_estimator_breaks_no_export():
    cell = SimpleNamespace(run=RunSource("a"), fault=FaultSet("clean"), estimator=EstimatorSpec("b", "b"), seed=0)
    lost = SimpleNamespace(cell=cell, status="crashed", error="red \x1b[31m & <b>\x00")
    failure = ElementTree.fromstring(as_junit(SimpleNamespace(name="s"), [lost])).find("testcase/failure")
    assert failure.text == "red ?[31m & <b>?"
    assert rb"a\{b\}\_1 & \textbackslash{}" in as_latex(Table("sizes", ("a{b}_1", "\\"), ()))
