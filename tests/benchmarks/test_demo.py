"""The whole promise in one command, cut short."""

import json

import fusion
from benchmarks import demo as module
from benchmarks.demo import demo
from benchmarks.runner.definition import load_suite
from fusion import ViewerError
from logs.reader import read_run


def no_driver(*_, **__):
    raise ViewerError("no driver here")


def small(folder):
    path = folder / "small.toml"
    path.write_text(
        '[suite]\nname = "small"\n[[runs]]\nid = "one"\nscenario = "office"\nduration_s = 6.0\n'
        '[[estimators]]\nid = "wheels"\nuse = "dead_reckoning"\n',
        encoding="utf-8",
    )
    return path


def test_suite_that_the_demo_reports_on_is_installed():
    assert load_suite(module.SUITE).name == "quick"


def test_demo_leaves_log_scores_review_and_report_and_outlives_a_missing_driver(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(module, "render", no_driver)
    made = demo(tmp_path / "demo", duration_s=6.0, suite=small(tmp_path), workers=1)
    assert read_run(made.log).truth is not None
    records = json.loads(made.records.read_text())
    assert {record["estimator"] for record in records} == set(fusion.available())
    assert made.scene is not None
    assert made.scene.stat().st_size > 0
    assert made.picture is None
    assert "no picture: no driver here" in capsys.readouterr().err
    assert "1 run, 1 estimator, no faults, 1 seed: 1 cell." in made.page.read_text(encoding="utf-8")


def test_command_prints_the_table_the_files_and_three_commands_to_try(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(module, "review", no_driver)
    short = {"duration_s": 6.0, "suite": small(tmp_path), "workers": 1}
    monkeypatch.setattr(module, "demo", lambda folder, *, seed: demo(folder, seed=seed, **short))
    from fusion.cli import main

    assert main(["demo", "-o", str(tmp_path / "demo"), "--no-view"]) == 0
    told = capsys.readouterr()
    assert "position error of" in told.out
    assert str(tmp_path / "demo" / "run.mcap") in told.out
    assert str(tmp_path / "demo" / "report.html") in told.out
    assert told.out.split("Try next:")[1].count("fusion ") == 3
    assert "no review: no driver here" in told.err
