"""The command line of the review, as far as nothing needs to be looked at."""

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.review.review import review
from fusion import ParameterError
from fusion.cli.main import main
from logs.reader import read_run


def run_review(capsys, *words):
    code = main(["review", *map(str, words)])
    return code, *capsys.readouterr()


def test_worst_moments_are_listed_with_a_command_that_opens_them_and_need_no_rerun(log, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    code, out, _ = run_review(capsys, log, "--estimators", "ekf,dead_reckoning", "--worst", "2")
    lines = out.splitlines()
    assert code == 0
    assert len(lines) == 8
    assert all(line.startswith(f"    fusion review {log} --estimators ") for line in lines[1::2])
    assert sum(line.endswith("; uses no radio") for line in lines[::2]) == 2


def test_worst_moment_is_the_largest_error_of_the_scores(log):
    made = review(log, estimators=["ekf"], worst=3)
    errors = [moment.error_m for moment in made.moments]
    assert errors == sorted(errors, reverse=True)
    assert made.files == []


def test_parameters_are_given_reach_the_estimator_and_stand_in_the_command(log, capsys):
    word = "ekf.gate_probability=0.5"
    _, plain, _ = run_review(capsys, log, "--estimators", "ekf", "--worst", "1")
    code, out, _ = run_review(capsys, log, "--estimators", "ekf", "--worst", "1", "--set", word)
    assert code == 0
    assert out.splitlines()[0] != plain.splitlines()[0]
    assert out.endswith(f" --set {word}\n")


def test_counterfactuals_show_what_the_error_of_a_worst_moment_would_have_been(log, capsys):
    _, out, _ = run_review(capsys, log, "--estimators", "ekf", "--worst", "1", "--without", "ap1")
    (moment,) = review(log, estimators=["ekf"], worst=1, without=["ap1"]).moments
    assert moment.otherwise["ekf without ap1"] != moment.error_m
    assert out.splitlines()[0].endswith(f"; ekf without ap1: {moment.otherwise['ekf without ap1']:.2f} m")


@pytest.mark.parametrize(
    ("word", "told_of"),
    [("ekf.gate=1", "gate_probability"), ("efk.gate_probability=0.9", "did you mean 'ekf'"), ("gate=1", "expected")],
)
def test_parameters_that_are_none_are_refused(log, capsys, word, told_of):
    code, _, err = run_review(capsys, log, "--estimators", "ekf", "--worst", "1", "--set", word)
    assert code == 1
    assert told_of in err


def test_layers_and_counterfactuals_are_written_and_named(log, tmp_path, capsys):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    folder = tmp_path / "layers"
    code, out, _ = run_review(
        capsys, log, "--estimators", "ekf", "--save", folder, "--without", "ap1", "--reject", "10"
    )
    assert code == 0
    names = ["base.rrd", "ekf.rrd", "ekf without ap1.rrd", "ekf reject 9.98 s.rrd"]
    assert out.splitlines() == [str(folder / name) for name in names]
    assert all((folder / name).stat().st_size > 10_000 for name in names)


def test_misspelt_anchor_is_refused_before_anything_is_written(log, tmp_path, capsys):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    code, _, err = run_review(capsys, log, "--save", tmp_path / "r.rrd", "--without", "ap11")
    assert (code, list(tmp_path.iterdir())) == (1, [])
    assert "did you mean 'ap1'?" in err


def test_web_refuses_a_folder_of_layers_and_states_what_it_takes(log, tmp_path, capsys):
    code, _, err = run_review(capsys, log, "--web", "--save", tmp_path / "layers")
    assert code == 1
    assert f"give --save {tmp_path / 'layers'}.rrd" in err


@pytest.mark.parametrize(
    "words", [["--at", "nan"], ["--at", "abc"], ["--at", "-1"], ["--reject", "inf"], ["--worst", "0"]]
)
def test_numbers_that_mean_nothing_are_usage_errors(log, capsys, words):
    with pytest.raises(SystemExit) as ended:
        main(["review", str(log), *words])
    assert ended.value.code == 2
    assert "give" in capsys.readouterr().err


def test_worst_moments_need_truth(log):
    with pytest.raises(ParameterError, match="no ground truth"):
        review(replace(read_run(log), truth=None), estimators=["dead_reckoning"], worst=1)


def test_made_up_run_of_the_cost_measurement_is_written(tmp_path):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    measure = runpy.run_path(str(Path(__file__).with_name("long_review.py")))
    assert measure["cost_s"](500, 2, tmp_path / "long.rrd") > 0.0
    assert (tmp_path / "long.rrd").stat().st_size > 10_000


def test_time_that_is_none_of_the_run_is_refused_before_any_work(log, tmp_path, capsys):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    code, _, err = run_review(capsys, log, "--estimators", "ekf", "--save", tmp_path / "r.rrd", "--at", "31")
    assert (code, list(tmp_path.iterdir())) == (1, [])
    assert "--at 31: " in err
    assert "give a time in between" in err
