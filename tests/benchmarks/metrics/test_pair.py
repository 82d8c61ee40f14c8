"""One track against the truth: both modes, alignment beside the raw score, and the golden run at 100 Hz."""

import argparse
import json
import math

import numpy as np
import pytest

from benchmarks.cli import bench_score as pair_verb
from benchmarks.metrics.alignment import align
from benchmarks.metrics.matching import Answers
from benchmarks.metrics.relative_pose import Poses, relative_errors
from benchmarks.metrics.score import errors, metrics
from benchmarks.metrics.track_files import read_track, read_truth
from benchmarks.metrics.track_pair import MODES, score_pair
from fusion import Estimate, FusionError, LogError, Odometry, ParameterError, Pose, Truth, Update, World
from logs.truth import Instants
from logs.writer import RunWriter

GOLDEN = {
    "pos_rmse": 0.324411033066140,
    "pos_mean": 0.320562732136,
    "pos_max": 0.514641566629,
    "pos_p50": 0.320376338469,
    "pos_p95": 0.402558712716,
    "pos_p99": 0.436855186232,
    "head_mae": math.radians(0.448598206389),
    "head_rmse": math.radians(0.564320370428),
}


def paired(truth, estimate):
    """Pose k with pose k, whatever their stamps."""
    (true, _), said = read_truth(truth), read_track(estimate)
    ages = np.zeros(len(true)), np.full(len(true), np.nan)
    answers = Answers(said.usable, *said.pose[:, :2].T, said.heading, said.covariance, *ages)
    return Instants(true.time_ns, true.x, true.y, true.heading), answers


def test_golden_run_has_its_golden_scores(oracle_d):
    instants, answers = paired(*oracle_d)
    measured = errors(instants, answers)
    scores = metrics(measured)
    for name, value in GOLDEN.items():
        # Twelve digits were written down, of files whose headings have nine decimals.
        assert scores[name] == pytest.approx(value, rel=2e-9), name
    poses = Poses.of(measured)
    for frames, value in ((1, 0.100051223731826), (100, 0.100687254741)):
        translation, _ = relative_errors(poses, slice(10_000 - frames), np.arange(frames, 10_000))
        assert np.sqrt(np.mean(translation**2)) == pytest.approx(value, rel=2e-9)
    aligned = align(instants, answers, "se2").answers
    assert metrics(errors(instants, aligned))["pos_rmse"] == pytest.approx(0.070878230169602, rel=2e-9)


def test_both_modes_agree_on_a_dense_estimate(oracle_d):
    causal, interp = score_pair(*oracle_d, hz=100.0), score_pair(*oracle_d, mode="interp")
    assert causal.metrics["pos_rmse"] == pytest.approx(GOLDEN["pos_rmse"], rel=0.01)
    assert interp.metrics["pos_rmse"] == pytest.approx(GOLDEN["pos_rmse"], rel=0.01)
    assert interp.metrics["availability"] == pytest.approx(1.0, abs=1e-3)
    assert score_pair(*oracle_d).metrics["n"] == 1000.0


def test_aligned_score_comes_with_its_transform_and_never_replaces_the_raw_one(oracle_d):
    score = score_pair(*oracle_d, mode="interp", alignment="se2")
    assert score.metrics["pos_rmse"] > 0.3
    assert score.aligned["pos_rmse"] == pytest.approx(0.0709, abs=1e-3)
    assert score.map_from_estimate[:2] == pytest.approx((-0.3, 0.1), abs=0.01)
    assert score.ratio == pytest.approx(score.metrics["pos_rmse"] / score.aligned["pos_rmse"])
    record = score.record()
    assert record["aligned"]["ratio"] == score.ratio
    assert record["anees"] is None
    assert math.isnan(score_pair(*oracle_d).ratio)


def test_dead_estimator_shows_in_causal_quantiles_and_in_the_availability_of_both(tmp_path, write_tum):
    t = 0.1 * np.arange(1001)
    zero = np.zeros(1001)
    write_tum(tmp_path / "truth.tum", t, 0.1 * t, zero, zero)
    write_tum(tmp_path / "dead.tum", t[:51], 0.1 * t[:51], zero[:51], zero[:51])
    causal = score_pair(tmp_path / "truth.tum", tmp_path / "dead.tum").metrics
    assert (causal["n_valid"], causal["pos_p75"]) == (61.0, math.inf)
    interp = score_pair(tmp_path / "truth.tum", tmp_path / "dead.tum", mode="interp").metrics
    assert interp["pos_p75"] < 1e-9
    assert interp["availability"] == pytest.approx(0.05, abs=1e-9)


def test_run_that_stood_still_says_it_is_not_alignable(tmp_path, write_tum, capsys):
    t = 0.1 * np.arange(100)
    zero = np.zeros(100)
    write_tum(tmp_path / "truth.tum", t, zero, zero, zero)
    score = score_pair(tmp_path / "truth.tum", tmp_path / "truth.tum", alignment="se2")
    assert score.aligned is None
    pair_verb.print_score(score)
    assert "not alignable by se2" in capsys.readouterr().out


def test_clocks_that_never_meet_are_named(tmp_path, write_tum):
    t, zero = 0.1 * np.arange(10), np.zeros(10)
    write_tum(tmp_path / "truth.tum", t, zero, zero, zero)
    write_tum(tmp_path / "later.tum", t + 1e6, zero, zero, zero)
    for mode in MODES:
        with pytest.raises(LogError, match="same clock"):
            score_pair(tmp_path / "truth.tum", tmp_path / "later.tum", mode=mode)


def test_recorded_answer_that_is_no_number_leaves_no_score(tmp_path):
    world = World.from_table({"name": "here", "bounds": {"x_min": 0, "x_max": 1, "y_min": 0, "y_max": 1}})
    with RunWriter(tmp_path / "run.mcap", world, name="run") as log:
        for k in range(10):
            odometry = Odometry(k * 10**8, "wheels", k, max(k - 1, 0) * 10**8, 0.1, 0.0)
            log.write(odometry)
            log.write_truth(Truth(k * 10**8, 0.1 * k, 0.0, 0.0))
            x = 0.1 * k if k < 4 else math.nan
            log.write_update("ekf", Update(odometry, Estimate(k * 10**8, Pose(x, 0.0, 0.0), None), ()))
    for mode in MODES:
        with pytest.raises(LogError, match=r"run\.mcap:ekf: it answers x nan m, .* 0\.4 s after its first answer"):
            score_pair(tmp_path / "run.mcap", f"{tmp_path / 'run.mcap'}:ekf", mode=mode)


def test_command_tells_what_of_the_truth_is_left_out(tmp_path, capsys):
    head = "time_s,x_m,y_m,heading_rad"
    (tmp_path / "truth.csv").write_text(f"{head}\n0,0,0,0\n1,,0,0\n2,2,0,\n3,3,0,0\n", encoding="utf-8")
    (tmp_path / "mine.csv").write_text(f"{head}\n0,0,0,0\n2,2,0,1\n3,3,0,0\n", encoding="utf-8")
    command("--truth", tmp_path / "truth.csv", "--estimate", tmp_path / "mine.csv", "--json", tmp_path / "out.json")
    printed = capsys.readouterr()
    assert "1 of 4 true poses have no position, and are left out" in printed.err
    assert "instants with a true heading" in printed.out
    record = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert (record["n"], record["head_n"], record["head_rmse"]) == (3.0, 2.0, 0.0)
    assert len(record["warnings"]) == 1


def test_unknown_mode_is_refused_before_anything_is_read():
    with pytest.raises(ParameterError, match="did you mean 'causal'"):
        score_pair("none", "none", mode="casual")
    with pytest.raises(ParameterError, match="did you mean 'origin'"):
        score_pair("none", "none", alignment="orgin")


def command(*words):
    parser = argparse.ArgumentParser()
    pair_verb.configure(parser)
    return pair_verb.run(parser.parse_args([str(word) for word in words]))


def test_command_prints_raw_and_aligned_beside_each_other_and_writes_all(oracle_d, tmp_path, capsys):
    truth, estimate = oracle_d
    out = tmp_path / "deep" / "score.json"
    command("--truth", truth, "--estimate", estimate, "--mode", "interp", "--align", "se2", "--json", out)
    printed = capsys.readouterr().out
    assert "estimate.tum against truth.tum" in printed
    assert "RMSE raw / aligned = 4.5" in " ".join(printed.split())
    row = next(line.split() for line in printed.splitlines() if line.strip().startswith("RMSE, cm"))
    record = json.loads(out.read_text(encoding="utf-8"))
    assert [float(cell) for cell in row[2:]] == pytest.approx(
        [100.0 * record["pos_rmse"], 100.0 * record["aligned"]["pos_rmse"]], abs=0.005
    )


def test_record_alone_goes_to_standard_output(oracle_d, capsys):
    truth, estimate = oracle_d
    assert command("--truth", truth, "--estimate", estimate, "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["mode"] == "causal"


def test_place_that_cannot_be_written_is_named(oracle_d, tmp_path):
    truth, estimate = oracle_d
    (tmp_path / "file").write_text("")
    with pytest.raises(FusionError, match="cannot be written"):
        command("--truth", truth, "--estimate", estimate, "--json", tmp_path / "file" / "out.json")


@pytest.mark.parametrize(
    ("truth_s", "said_s", "message"),
    [
        (np.arange(0.0, 60.0, 5.0), np.arange(1.0, 50.0, 5.0), "sparser everywhere; use --mode causal"),
        (np.arange(0.0, 60.0, 0.1), np.array([30.0, 99.0]), "fewer than two poses lie within the truth"),
    ],
)
def test_what_cannot_be_interpolated_says_why(tmp_path, write_tum, truth_s, said_s, message):
    for name, stamps in (("truth", truth_s), ("mine", said_s)):
        write_tum(tmp_path / f"{name}.tum", stamps, stamps, 0.0 * stamps, 0.0 * stamps)
    with pytest.raises(LogError, match=message):
        score_pair(tmp_path / "truth.tum", tmp_path / "mine.tum", mode="interp")
