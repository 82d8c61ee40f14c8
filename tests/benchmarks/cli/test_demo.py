"""The whole promise in one command, cut short."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import fusion
from benchmarks.cli import demo as module
from benchmarks.cli.demo import demo, next_commands, program
from benchmarks.review.reviewed_run import own_log
from benchmarks.runner.suite_file import load_suite
from fusion import ViewerError
from logs.reader import read_run

FUSION = Path(sys.executable).with_name("fusion")
"""As installed beside this Python."""


def no_driver(*_, **__):
    raise ViewerError("no driver here")


def small(folder):
    path = folder / "small.toml"
    path.write_text(
        '[suite]\nname = "small"\n[[runs]]\nid = "one"\nscenario = "office"\nduration_s = 6.0\n'
        '[[estimators]]\nid = "wheels"\nuse = "dead_reckoning"\n[[estimators]]\nid = "ekf"\nuse = "ekf"\n',
        encoding="utf-8",
    )
    return path


def test_suite_that_the_demo_reports_on_is_installed():
    assert load_suite(module.SUITE).name == "quick"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """One demo for all, in the folder `my demo` of the current one."""
    here = tmp_path_factory.mktemp("here")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(here)
        yield demo(Path("my demo"), duration_s=6.0, suite=small(here), workers=1)


def test_demo_leaves_log_scores_and_report(made):
    assert read_run(made.log).truth is not None
    records = json.loads(made.records.read_text())
    assert {record["estimator"] for record in records} == set(fusion.available())
    assert "1 run, 2 estimators, no faults, 1 seed: 2 cells." in made.page.read_text(encoding="utf-8")


def test_review_and_picture_are_there_where_rerun_cannot_draw(made, tmp_path, monkeypatch, capsys):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    monkeypatch.setattr(module, "render", no_driver)
    drawn = module._draw(own_log(made.log), tmp_path, 0)
    assert drawn.scene.stat().st_size > 0
    assert drawn.picture.read_bytes().startswith(b"\x89PNG")
    assert not drawn.rendered
    assert f"{drawn.picture} is by matplotlib, not by Rerun: no driver here\n" in capsys.readouterr().err


def test_command_prints_the_table_the_files_and_three_commands_that_run_as_printed(made, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("PATH", os.defpath)
    asked = []
    monkeypatch.setattr(module, "demo", lambda *folder, **more: asked.append((folder, more)) or made)
    from fusion.cli.main import main

    assert main(["demo", "-o", "my demo", "--seed", "3"]) == 0
    assert asked == [((Path("my demo"),), {"seed": 3})]
    printed = capsys.readouterr().out
    assert "position error of" in printed
    for name in ("run.mcap", "review.png", "report.html"):
        assert f"my demo/{name}\n" in printed
        assert Path("my demo", name).stat().st_size > 0
    commands = printed.split("Try next:\n")[1].splitlines()
    assert len(commands) == 3
    for command in commands:
        ran = subprocess.run(command, check=False, shell=True, capture_output=True, text=True)
        assert ran.returncode == 0, (command, ran.stderr)
        assert ran.stdout


def made_with(drawn):
    return module.Demo(Path("out/run.mcap"), Path("out/scores.json"), [], drawn, Path("quick"), None)


@pytest.mark.parametrize(
    ("window", "rendered", "words"),
    [
        (True, True, "review out/run.mcap"),
        (False, True, "review out/run.mcap --estimators ekf,particle --png out/two.png"),
        (False, False, "review out/run.mcap --estimators ekf --worst 3"),
    ],
)
def test_review_that_is_proposed_is_one_that_this_machine_can_make(window, rendered, words):
    first, *_ = next_commands(made_with(module.Drawn(None, None, rendered)), window=window)
    assert first == f"{program()} {words}"


def test_without_rerun_and_without_matplotlib_one_line_names_both_remedies(made, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert module._draw(own_log(made.log), tmp_path, 0) == module.Drawn(None, None, rendered=False)
    assert module._report(made.suite, made.log.parent, 1) is None
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "no picture" in line]
    assert "fusion-localization[review]" in line
    assert "fusion-localization[plots]" in line


def test_program_is_named_as_a_shell_finds_it(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", [str(FUSION), "demo"])
    monkeypatch.setenv("PATH", str(FUSION.parent))
    assert program() == "fusion"
    other = tmp_path / "fusion"
    other.write_text("#!/bin/sh\n", encoding="utf-8")
    other.chmod(0o755)
    for path in (tmp_path, tmp_path / "empty"):
        monkeypatch.setenv("PATH", str(path))
        assert program() == str(FUSION)
    monkeypatch.chdir(FUSION.parents[2])
    monkeypatch.setattr(sys, "argv", [str(FUSION.relative_to(Path.cwd())), "demo"])
    assert program() == str(Path(FUSION.parts[-3], FUSION.parts[-2], "fusion"))
