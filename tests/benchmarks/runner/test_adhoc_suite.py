"""The bench on small logs: what is refused, what is survived, what is reported."""

import json
import math
import re

import numpy as np
import pytest

import fusion
from benchmarks.runner.adhoc_suite import bench, remarks, tables, write_records
from benchmarks.runner.estimator_run import run_estimator
from benchmarks.runner.leaderboard import entries, rank
from benchmarks.runner.results import detailed
from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    LogError,
    NotInstalledError,
    Odometry,
    ParameterError,
    PluginError,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    Reason,
    Truth,
)
from fusion.cli.main import main
from fusion.cli.options import parse_settings
from fusion.output.tables import print_tables
from fusion.timeline import order
from logs.prior import starting_prior
from logs.run import Run
from logs.truth import TruthTrack
from logs.writer import RunWriter
from tests.fusion.streams import WORLD as ANCHORED
from tests.fusion.streams import CountingWorld, ranges

TENTH_NS = 100_000_000
WORLD = fusion.World.from_table({"name": "corridor", "bounds": {"x_min": 0, "x_max": 8, "y_min": -1, "y_max": 3}})


class Wheels:
    """Believes the wheels, with an error of ``shift_m`` in x."""

    summary = "odometry alone"
    tags = frozenset()

    def __init__(self, world, shift_m: float = 0.0):
        self.shift_m = shift_m

    def start(self, prior, seed):
        return prior.pose

    def step(self, state, motion, scan):
        return state.compose(motion.pose), ()

    def estimate(self, state, motion, time_ns):
        x, y, heading = state.compose(motion.pose)
        return Estimate(time_ns, Pose(x + self.shift_m, y, heading), Covariance.from_std(0.1, 0.1, 0.1))


class Dies(Wheels):
    def estimate(self, state, motion, time_ns):
        if time_ns > 32 * TENTH_NS:
            raise ZeroDivisionError("half way")
        return super().estimate(state, motion, time_ns)


class Drifts(Wheels):
    """Takes every metre for 1.1 m."""

    def estimate(self, state, motion, time_ns):
        answer = super().estimate(state, motion, time_ns)
        return answer._replace(pose=answer.pose._replace(x=1.1 * answer.pose.x))


class Quiet(Wheels):
    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(valid=time_ns < 20 * TENTH_NS)


class Diverges(Wheels):
    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(pose=Pose(math.nan, 0.0, 0.0))


class Poisoned(Wheels):
    """Right for one second, then no number at all."""

    def estimate(self, state, motion, time_ns):
        answer = super().estimate(state, motion, time_ns)
        return answer if time_ns <= 10 * TENTH_NS else answer._replace(pose=Pose(*[math.nan] * 3))


@pytest.fixture(autouse=True)
def _estimators():
    with (
        fusion.registered("toy_wheels", Wheels),
        fusion.registered("toy_dies", Dies),
        fusion.registered("toy_drifts", Drifts),
        fusion.registered("toy_quiet", Quiet),
        fusion.registered("toy_diverges", Diverges),
        fusion.registered("toy_poisoned", Poisoned),
    ):
        yield


def write_run(path, *, truth=True, steps=50):
    with RunWriter(path, WORLD, name=path.stem) as writer:
        for k in range(steps + 1):
            if truth:
                writer.write_truth(Truth(k * TENTH_NS, 0.1 * k, 0.0, 0.0))
            if k:
                writer.write(Odometry(k * TENTH_NS, "wheels", k, (k - 1) * TENTH_NS, 0.1, 0.0))
    return path


def run_in_memory(**changes):
    odometry = tuple(Odometry(k * TENTH_NS, "wheels", k, (k - 1) * TENTH_NS, 0.1, 0.0) for k in range(3, 60))
    track = TruthTrack(np.arange(60) * TENTH_NS, np.arange(60) * 0.1, np.zeros(60), np.zeros(60))
    fields = {"path": None, "name": "run", "world": WORLD, "prior": None, "metadata": {}, "measurements": odometry}
    return Run(**{**fields, "truth": track, "warnings": (), "lanes": {}, **changes})


def test_perfect_wheels_score_zero_and_a_shift_scores_itself(tmp_path):
    log = write_run(tmp_path / "run.mcap")
    perfect, shifted = (
        bench([log], estimators=["toy_wheels"], settings={"toy_wheels": {"shift_m": shift}}, workers=1)[0]
        for shift in (0.0, 0.25)
    )
    assert perfect.status == "ok"
    assert perfect.metrics["pos_max"] == pytest.approx(0.0, abs=1e-9)
    assert shifted.metrics["pos_p75"] == pytest.approx(0.25, rel=1e-9)
    assert shifted.metrics["anees_2d"] == pytest.approx(0.25**2 / 0.1**2 / 2.0, rel=1e-9)


def test_dead_and_diverged_estimators_rank_below_a_poor_one_that_lives(tmp_path):
    log = write_run(tmp_path / "run.mcap")
    scores = bench(
        [log],
        estimators=["toy_dies", "toy_quiet", "toy_diverges", "toy_wheels"],
        settings={"toy_wheels": {"shift_m": 100.0}},
        workers=1,
    )
    status = {score.estimator: score.status for score in scores}
    assert status == {
        "toy_wheels": "ok",
        "toy_quiet": "diverged",
        "toy_diverges": "diverged",
        "toy_dies": "crashed",
    }
    ranking = [entry.name for entry in sorted(entries(scores), key=rank)]
    assert (ranking[0], ranking[-1]) == ("toy_wheels", "toy_dies")


def test_half_a_run_before_a_crash_is_no_result(tmp_path):
    (score,) = bench([write_run(tmp_path / "run.mcap")], estimators=["toy_dies"], workers=1)
    assert "half way" in score.error
    assert score.metrics["availability"] == 0.0
    assert detailed(score)["pos_p50"] is None


FLATTERING = (
    "pos_rmse",
    "pos_mean",
    "pos_max",
    "head_rmse",
    "anees",
    "along_rmse",
    "rpe_t_1s_rmse",
    "energy",
    "vel_err",
)


def test_answer_that_is_no_number_leaves_no_score_of_the_seconds_before_it(tmp_path, capsys):
    scores = bench([write_run(tmp_path / "run.mcap")], estimators=["toy_poisoned", "toy_wheels"], workers=1)
    poisoned, wheels = (detailed(score) for score in scores)
    assert all(wheels[name] is not None for name in FLATTERING)
    assert [poisoned[name] for name in FLATTERING] == [None] * len(FLATTERING)
    assert (poisoned["status"], poisoned["availability"], poisoned["pos_p50"]) == ("diverged", 0.0, None)
    cause = "it answers x nan m, y nan m, heading nan rad, 1 s after its first answer, so none of its answers is scored"
    assert poisoned["error"] == cause
    assert f"run: toy_poisoned diverged: {cause}" in remarks(scores)
    print_tables(tables(scores))
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.lstrip().startswith("toy_poisoned")]
    assert row.split()[:9] == ["toy_poisoned", "(diverged)", "–", "–", "∞", "∞", "∞", "–", "–"]
    assert "0.0" in row.split()[10], "the availability"


def test_answer_that_is_no_number_leaves_no_score_where_there_is_no_truth_either(tmp_path):
    (score,) = bench([write_run(tmp_path / "run.mcap", truth=False)], estimators=["toy_poisoned"], workers=1)
    assert (score.status, score.metrics["availability"]) == ("diverged", 0.0)
    assert any("toy_poisoned diverged: it answers x nan m" in remark for remark in remarks([score]))


def test_estimator_that_falls_silent_keeps_only_what_counts_its_silence(tmp_path):
    (score,) = bench([write_run(tmp_path / "run.mcap")], estimators=["toy_quiet"], workers=1)
    record = detailed(score)
    assert [record[name] for name in FLATTERING] == [None] * len(FLATTERING)
    assert record["error"] == "only 37.3 % of the instants have a valid answer"
    assert (record["n"], record["n_valid"], record["pos_cdf_1m"]) == (51.0, 19.0, 19.0 / 51.0)
    assert record["availability"] == 19.0 / 51.0
    assert score.metrics["pos_p75"] == math.inf


def test_records_are_strict_json_with_flat_metrics(tmp_path):
    scores = bench([write_run(tmp_path / "run.mcap")], estimators=["toy_wheels", "toy_quiet"], workers=1, seed=4)
    write_records(scores, tmp_path / "new" / "scores.json")
    text = (tmp_path / "new" / "scores.json").read_text()
    good, quiet = json.loads(text, parse_constant=pytest.fail)
    assert (good["run"], good["estimator"], good["status"], good["seed"]) == ("run", "toy_wheels", "ok", 4)
    assert good["world_hash"] == WORLD.hash
    assert len(good["digest"]) == 64
    assert set(good["fates"]) == {decision.value for decision in Decision}
    assert quiet["pos_p75"] is None
    assert quiet["status"] == "diverged"


def test_log_without_truth_is_named_and_the_rest_reported(tmp_path, capsys):
    scores = bench([write_run(tmp_path / "run.mcap", truth=False)], estimators=["toy_wheels"], workers=1)
    assert scores[0].status == "unscored"
    assert detailed(scores[0])["digest"]
    assert [remark for remark in remarks(scores) if "no ground truth" in remark]
    print_tables(tables(scores))
    out = capsys.readouterr().out
    assert "toy_wheels" in out
    assert "RMSE" not in out


class Hears(Wheels):
    """Expects every range to be 5 m, 0.5 m sure; answers nothing valid in the first second."""

    def step(self, state, motion, scan):
        state, _ = super().step(state, motion, scan)
        if scan is None:
            return state, ()
        who = (scan.time_ns, scan.sensor, scan.seq)
        error = scan.readings[0].range_m - 5.0
        return state, (Fate(*who, "a", Decision.USED, Reason.OK, 1.0, error, 0.25, error**2 / 0.25),)

    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(valid=time_ns > 1_000_000_000)


@pytest.mark.parametrize(("error_m", "honest"), [(0.5, True), (1.5, False)])
def test_log_without_truth_shows_consistency_availability_and_time(tmp_path, capsys, error_m, honest):
    """Ranges off by plus and minus so much, forty of them from 0.1 s to 4 s: NIS 1, or 9."""
    world = fusion.World.from_table({"anchors": [{"id": "a", "position_m": [0, 0]}]})
    with RunWriter(tmp_path / "run.mcap", world, name="run") as writer:
        for k in range(1, 41):
            writer.write(Ranges(k * TENTH_NS, "uwb", k, (RangeReading("a", 5.0 + error_m * (-1) ** (k // 2)),)))
    with fusion.registered("toy_hears", Hears):
        (score,) = bench([tmp_path / "run.mcap"], estimators=["toy_hears"], workers=1)
    record = json.loads(json.dumps(detailed(score), allow_nan=False))
    assert record["nis_ranges"] == pytest.approx(error_m**2 / 0.25)
    assert (record["nis_ranges_low"] < record["nis_ranges"] < record["nis_ranges_high"]) == honest
    assert record["availability"] == pytest.approx(30 / 40)
    print_tables(tables([score]))
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "toy_hears" in line]
    band = [f"{record[f'nis_ranges{end}']:.2f}" for end in ("", "_low", "_high")]
    inside = "100.0" if honest else "0.0"
    assert row.split() == ["toy_hears", *band, inside, "75.0", f"{1e6 * record['cpu_per_measurement_s']:.0f}"]


def test_runs_without_truth_stay_out_of_the_table_of_all(tmp_path, capsys):
    logs = [write_run(tmp_path / f"{k}" / "run.mcap", truth=k > 0) for k in range(3)]
    scores = bench(logs, estimators=["toy_wheels"], workers=1)
    print_tables(tables(scores))
    assert "the 2 runs with truth: medians over runs" in capsys.readouterr().out
    print_tables(tables(scores[:2]))
    assert "medians" not in capsys.readouterr().out


def test_true_heading_that_is_known_in_part_is_reported_with_its_number(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="run") as writer:
        for k in range(60):
            writer.write_truth(Truth(k * TENTH_NS, 0.1 * k, 0.0, 0.0 if k < 45 else None))
            writer.write(Odometry(k * TENTH_NS, "wheels", k, (k - 1) * TENTH_NS, 0.1, 0.0))
    (score,) = bench([tmp_path / "run.mcap"], estimators=["toy_wheels"], workers=1)
    (remark,) = remarks([score])
    assert remark == "run: the true heading is known at 45 of 60 instants, and heading errors are of these alone"
    assert detailed(score)["head_n"] == 45.0


def test_table_over_several_runs_has_medians_and_the_worst(tmp_path, capsys):
    runs = [write_run(tmp_path / f"{k}.mcap", steps=10 * k) for k in (1, 2, 3)]
    results = bench(runs, estimators=["toy_drifts"], workers=1)
    rmse = [score.metrics["pos_rmse"] for score in results]
    assert rmse == sorted(rmse)
    print_tables(tables(results)[-1:])
    (row,) = [line.split() for line in capsys.readouterr().out.splitlines() if "toy_drifts" in line]
    assert row[:4] == ["toy_drifts", "3/3", f"{100 * rmse[1]:.1f}", f"{100 * rmse[2]:.1f}"]


def test_logs_of_one_name_are_distinguished_by_their_place(tmp_path):
    runs = [write_run(tmp_path / name / "run.mcap") for name in "ab"]
    assert [score.run for score in bench(runs, estimators=["toy_wheels"], workers=1)] == list(map(str, runs))


def test_table_is_in_centimetres_and_names_the_status(tmp_path, capsys):
    log = write_run(tmp_path / "run.mcap")
    scores = bench([log], estimators=["toy_wheels", "toy_dies"], settings={"toy_wheels": {"shift_m": 0.25}}, workers=1)
    print_tables(tables(scores))
    table = capsys.readouterr().out
    assert "25.0" in table
    assert "toy_dies (crashed)" in table
    assert "∞" in table


def test_what_is_misspelt_is_refused_before_any_work(tmp_path):
    log = write_run(tmp_path / "run.mcap")
    with pytest.raises(PluginError, match="did you mean 'toy_wheels'"):
        bench([log], estimators=["toy_weels"])
    with pytest.raises(ParameterError, match="did you mean 'shift_m'"):
        bench([log], estimators=["toy_wheels"], settings={"toy_wheels": {"shift": 1.0}})
    with pytest.raises(ParameterError, match="not among the chosen ones"):
        bench([log], estimators=["toy_wheels"], settings={"toy_dies": {"shift_m": 1.0}})
    with pytest.raises(LogError, match=r"nothing\.mcap: no such file"):
        bench([tmp_path / "nothing.mcap"], estimators=["toy_wheels"])
    with pytest.raises(ParameterError, match=r"ESTIMATOR\.PARAMETER=VALUE"):
        parse_settings(["gate=0.99"])


def test_estimator_that_is_not_installed_is_left_out_and_refused_by_name(stranger, tmp_path, capsys):
    path = write_run(tmp_path / "run.mcap")
    with pytest.raises(NotInstalledError, match=re.escape(f"lacking_two: {stranger}")):
        bench([path], estimators=["dead_reckoning", "lacking_two"], workers=1)
    assert main(["bench", str(path), "--workers", "1", "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith(f"fusion bench: lacking_one, lacking_two: {stranger}\n")
    assert printed.err.count("no_such_package") == 1
    assert {row["estimator"] for row in json.loads(printed.out)} == {*fusion.names()} - {"lacking_one", "lacking_two"}


def test_same_cell_twice_gives_the_same_digest(tmp_path):
    log = write_run(tmp_path / "run.mcap")
    first, second = (bench([log], estimators=["toy_wheels"], workers=1)[0].digest for _ in range(2))
    assert first == second


def test_updates_before_a_crash_are_kept():
    estimator_run = run_estimator(run_in_memory(), "toy_dies")
    assert len(estimator_run.updates) == 30
    assert "half way" in estimator_run.error
    assert len(estimator_run.final) == 30


def test_measurements_of_a_run_are_screened_and_integrated_once_for_all_estimators():
    counting = CountingWorld(ANCHORED)
    scans = tuple(ranges(k * TENTH_NS + 1, k) for k in range(5, 60, 5))
    measurements = tuple(sorted([*run_in_memory().measurements, *scans], key=order))
    run = run_in_memory(world=counting, measurements=measurements)
    estimator_runs = [run_estimator(run, name, seed=seed) for name in ("toy_wheels", "toy_quiet") for seed in range(3)]
    assert counting.asked == dict.fromkeys("abc", len(scans))
    first, *others = (
        [epoch for update in estimator_run.updates for epoch in update.epochs] for estimator_run in estimator_runs
    )
    assert len(first) == len(scans)
    for epochs in others:
        assert all(mine.motion is theirs.motion for mine, theirs in zip(epochs, first, strict=True))


def test_prior_of_the_log_goes_before_the_truth_and_the_truth_before_nothing():
    known = Prior(5, Pose(1.0, 2.0, 3.0), Covariance.from_std(1.0, 1.0, 1.0))
    assert starting_prior(run_in_memory(prior=known)) is known
    from_truth = starting_prior(run_in_memory())
    assert (from_truth.time_ns, from_truth.pose) == (2 * TENTH_NS, Pose(0.2, 0.0, 0.0))
    nothing = starting_prior(run_in_memory(truth=None))
    assert nothing.pose == Pose(4.0, 1.0, 0.0)
    assert not nothing.position_known
    assert not nothing.heading_known


def test_prior_from_truth_without_heading_leaves_the_heading_unknown():
    blind = TruthTrack(np.array([0]), np.array([1.0]), np.array([2.0]), np.array([math.nan]))
    prior = starting_prior(run_in_memory(truth=blind))
    assert prior.position_known
    assert not prior.heading_known
    assert prior.pose == Pose(1.0, 2.0, 0.0)


@pytest.mark.parametrize("words", [["bench"], ["review"], ["replay", "--estimator", "ekf"]])
def test_seed_below_zero_is_refused(words, capsys):
    """Each estimator that draws used to crash by itself."""
    with pytest.raises(SystemExit) as refusal:
        main([*words, "run.mcap", "--seed", "-1"])
    assert refusal.value.code == 2
    assert "-1 is no seed; give a whole number from 0 on" in capsys.readouterr().err
