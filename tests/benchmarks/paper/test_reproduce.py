"""`fusion reproduce` on a few runs: the same bytes for the same seed, nothing judged on what it was calibrated on."""

import json
import re

import numpy as np
import pytest

import fusion
from benchmarks.cli import reproduce as module
from benchmarks.metrics.matching import match
from benchmarks.metrics.score import errors
from benchmarks.paper.claims import in_words
from benchmarks.paper.experiment import run_experiments
from benchmarks.paper.figures import FIGURES
from benchmarks.paper.fit_environments import SEEDS
from benchmarks.paper.interpretations import INTERPRETATIONS, ORIGINS_M, literal
from benchmarks.paper.page import markdown
from benchmarks.paper.published import EKF, ENVIRONMENTS, ODOMETRY, PROPOSED, WIFI
from benchmarks.paper.reproduce import reproduce
from benchmarks.paper.trial import GYRO, GYRO_ESTIMATORS, run_alternative, run_trial
from benchmarks.paper.variants import with_gyro
from benchmarks.runner.estimator_run import run_estimator
from fusion import ParameterError, WorldError
from fusion.cli.main import main
from fusion.output.tables import as_markdown
from logs.truth import evaluation_instants
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulated_run

PAPER = {ODOMETRY, WIFI, PROPOSED, EKF, *(name + GYRO for name in GYRO_ESTIMATORS)}
"""Estimators that are run whatever is asked for."""


@pytest.fixture(scope="module")
def seen():
    """What is reported of the progress of the `report`."""
    return []


@pytest.fixture(scope="module")
def report(seen):
    """Two runs of everything, by two processes."""
    return reproduce(2, seed=5, workers=2, progress=lambda done, total, what: seen.append((done, total)))


def test_progress_counts_every_run(report, seen):
    assert seen == [(done, len(seen)) for done in range(1, len(seen) + 1)]


def test_a_seed_gives_its_run_whichever_is_the_first_and_whatever_the_workers(report):
    """Seed 6 by itself in this process is the second of the two by two processes, in every array."""
    for alone, both in zip(run_experiments(1, seed=6, estimators=["particle"]), report.outcomes, strict=True):
        assert (alone.seeds, both.seeds) == ((6,), (5, 6))
        assert set(alone.errors) == {"particle", *PAPER}
        assert all(np.array_equal(alone.errors[name][0], both.errors[name][1]) for name in alone.errors)
        for what in ("refused", "interpretations", "missing", "origins", "moves"):
            assert np.array_equal(getattr(alone, what)[0], getattr(both, what)[1])
        assert alone.alternatives == {
            filling: {curve: largest[1:] for curve, largest in curves.items()}
            for filling, curves in both.alternatives.items()
        }
        assert np.array_equal(alone.bound, both.bound)


def test_every_estimator_runs_on_the_same_runs_and_some_on_a_gyro(report):
    for outcome in report.outcomes:
        assert set(outcome.errors) == {*fusion.built_in_names(), *(name + GYRO for name in GYRO_ESTIMATORS)}
        assert {e.shape for e in outcome.errors.values()} == {(2, outcome.environment.trial_points, 2)}
        assert not outcome.crashes


def test_literal_reading_and_unmoved_origin_are_the_proposed_method_itself(report):
    for outcome in report.outcomes:
        own = outcome.largest(PROPOSED)
        assert outcome.interpretations[:, INTERPRETATIONS.index(literal())] == pytest.approx(own, abs=1e-6)
        assert outcome.origins[:, ORIGINS_M.index(0.0)] == pytest.approx(own, abs=1e-6)


def test_what_is_refused_leaves_the_answer_where_odometry_had_it(report):
    """Until the first fix is taken, the proposed method is dead reckoning; there it differs."""
    for outcome in report.outcomes:
        for refused, proposed, odometry in zip(
            outcome.refused, outcome.errors[PROPOSED], outcome.errors[ODOMETRY], strict=True
        ):
            first = int(np.argmin(refused)) if not refused.all() else len(refused)
            assert proposed[:first] == pytest.approx(odometry[:first], abs=1e-9)
            assert not np.allclose(proposed[first : first + 1], odometry[first : first + 1]) or first == len(refused)


def test_alternative_of_the_main_scenario_is_the_trial_itself():
    scenario = load_scenario("paper_mec")
    brief, whole = run_alternative((scenario, 8)), run_trial(("paper_mec", 8), estimators=[])
    for name in (ODOMETRY, WIFI):
        assert brief[name] == pytest.approx(np.abs(whole.errors[name]).max(), abs=1e-6)
    assert brief["coordinate"] == pytest.approx(np.abs(whole.errors[PROPOSED]).max(), abs=1e-6)


class Broken:
    summary, tags = "breaks", frozenset()

    def __init__(self, world):
        pass

    def start(self, prior, seed):
        raise ZeroDivisionError

    def step(self, state, motion, scan):
        return state, ()

    def estimate(self, state, motion, time_ns):
        raise NotImplementedError


def test_what_else_is_installed_stays_out_of_the_paper_unless_it_is_asked_for():
    with fusion.registered("broken", Broken):
        assert "broken" not in run_trial(("paper_office", 0)).errors
        asked = run_trial(("paper_office", 0), estimators=["broken", "particle"])
    assert set(asked.errors) == {"broken", "particle", *PAPER}


def test_unknown_estimator_is_refused_before_any_work(capsys):
    assert main(["reproduce", "--estimators", "ekf,particel"]) == 1
    assert "did you mean 'particle'" in capsys.readouterr().err


def test_estimator_that_crashes_costs_its_own_result_and_is_reported():
    with fusion.registered("broken", Broken):
        trial = run_trial(("paper_office", 0), estimators=["broken"])
    assert "ZeroDivisionError" in trial.crashes["broken"]
    assert np.isinf(trial.errors["broken"]).all()
    assert np.isfinite(trial.errors["ekf"]).all()


@pytest.mark.parametrize("seed", [SEEDS.start, SEEDS.stop - 1, SEEDS.start - 1])
def test_seeds_of_the_calibration_are_refused(seed):
    with pytest.raises(ParameterError, match="calibrated on; choose another --seed"):
        reproduce(2, seed=seed)


@pytest.mark.parametrize(("trials", "seed"), [(0, 0), (1, -1)])
def test_trials_or_seeds_without_a_meaning_are_refused(trials, seed):
    with pytest.raises(ParameterError, match="trials from seed"):
        reproduce(trials, seed=seed)


def test_missing_scenarios_are_reported(tmp_path):
    with pytest.raises(WorldError, match=r"alternatives\.toml: no numbers .*--calibrate"):
        reproduce(1, scenarios=tmp_path)


def test_gyro_turns_are_nearer_the_truth_than_wheel_turns():
    """On the arena's lap of 18 turns, the heading that dead reckoning ends with; median of 5 runs."""
    scenario, wheels, gyro = load_scenario("paper_arena"), [], []
    for seed in range(5):
        run = simulated_run(scenario, seed)
        for each, into in ((run, wheels), (with_gyro(run, scenario.reality), gyro)):
            instants = evaluation_instants(each.truth)
            into.append(errors(instants, match(instants, run_estimator(each, ODOMETRY).track)).heading[-1])
    assert np.median(gyro) < 0.5 * np.median(wheels)


def test_page_has_every_table_and_figure_and_leaves_no_place_open(report):
    text = markdown(report, lambda name: f"{name}.png")
    assert "{{" not in text
    assert all(as_markdown(table) in text for table in report.tables.values())
    assert all(f"]({name}.png)" in text for name in FIGURES)
    assert "inconclusive from 2 runs" in text
    assert f"{in_words(report.judged)} How often" in text


def test_command_prints_tables_and_writes_what_is_asked(report, tmp_path, monkeypatch, capsys):
    asked = {}

    def held(trials, **more):
        asked.update(more, trials=trials)
        return report

    monkeypatch.setattr(module, "reproduce", held)
    files = {kind: tmp_path / f"paper.{kind}" for kind in ("json", "html", "png")}
    page = tmp_path / "docs" / "paper.md"
    words = [word for kind, path in files.items() for word in (f"--{kind}", str(path))]
    assert (
        main(["reproduce", "--trials", "2", "--seed", "5", *words, "--markdown", str(page), "--estimators", "ekf"]) == 0
    )
    assert (asked["trials"], asked["seed"], asked["estimators"]) == (2, 5, ["ekf"])
    out = capsys.readouterr().out
    for table in report.tables.values():
        assert table.title.split(":")[0] in out
    assert f"\n{in_words(report.judged)}\n" in out
    assert json.loads(files["json"].read_text()) == json.loads(json.dumps(report.record(), allow_nan=False))
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in page.parent.iterdir()} == {"paper.md", *(f"paper-{name}.png" for name in FIGURES)}
    html = files["html"].read_text()
    assert html.count("data:image/png;base64,") == len(FIGURES)
    assert not re.search(r'(src|href)="(?!data:)', html)
    assert html.count("<table>") == html.count("</table>") > len(report.tables)


def test_file_that_cannot_be_written_is_reported_before_any_work(tmp_path, capsys):
    assert main(["reproduce", "--json", str(tmp_path)]) == 1
    assert "cannot be written" in capsys.readouterr().err


def test_calibrate_writes_scenarios_and_does_nothing_else(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(module, "write_calibrated", lambda folder, **_: [folder / "paper_office.toml"])
    assert main(["reproduce", "--calibrate", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'paper_office.toml'}\n"


@pytest.mark.parametrize("words", [["--trials", "0"], ["--trials", "x"], ["--workers", "0"], ["--trails", "3"]])
def test_wrong_words_are_wrong_usage(words, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["reproduce", *words])
    assert stop.value.code == 2


def test_published_numbers_are_those_of_the_three_environments():
    assert [(e.path_loss_exponent, e.trial_points) for e in ENVIRONMENTS] == [(2.27, 7), (2.13, 12), (1.71, 18)]
    assert [tuple(e.maxima_m.values()) for e in ENVIRONMENTS] == [
        (0.24, 0.82, 0.05),
        (1.68, 0.86, 0.53),
        (1.75, 4.52, 0.8),
    ]
