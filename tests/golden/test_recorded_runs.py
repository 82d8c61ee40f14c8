"""Real recordings: dead reckoning and EKF against the reference figures published with the data."""

from pathlib import Path

import pytest

from benchmarks.runner.adhoc_suite import bench
from logs.cli.import_ import import_recordings

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"


def rmse(kind, folder, estimators, output):
    """Position RMSE [m] by run and estimator."""
    if not (DATA / folder).is_dir():
        pytest.skip(f"the recordings of {folder} are not here")
    scores = bench(import_recordings(kind, DATA / folder, output), estimators=estimators, workers=1)
    return {(score.run, score.estimator): score.metrics["pos_rmse"] for score in scores}


def test_labyrinth_agrees_with_its_reference(tmp_path):
    """Reference: odometry 0.064 m, plain EKF with the offset taken off 0.069 m."""
    got = rmse("tuc", "tuc_labyrinth_uwb", ["dead_reckoning", "ekf", "filterpy_ekf"], tmp_path)
    assert got["Indoor_UWB", "dead_reckoning"] == pytest.approx(0.064, rel=0.1)
    assert got["Indoor_UWB", "ekf"] < 0.069 * 1.1
    assert got["Indoor_UWB", "filterpy_ekf"] == pytest.approx(0.069, rel=0.1)


def test_plaza_agrees_with_its_reference(tmp_path):
    """Reference: odometry 1.935 m, plain EKF with calibrated ranges 0.345 m."""
    got = rmse("plaza", "plaza", ["dead_reckoning", "ekf", "filterpy_ekf"], tmp_path)
    assert got["Plaza1", "dead_reckoning"] == pytest.approx(1.935, rel=0.1)
    assert got["Plaza1", "ekf"] == pytest.approx(0.345, rel=0.1)


def test_wifi_table_runs_agree_with_their_reference(tmp_path):
    """Reference RMSE of a plain EKF; ours may be better, and is nowhere worse by more than a tenth."""
    reference = {"trial-exp2": 0.525, "trial-exp3": 0.403, "trial1-exp2.1": 0.367, "trial1-exp3.1": 0.555}
    got = rmse("cdoa", "herolab_cdoa_wifi", ["ekf"], tmp_path)
    assert {name: got[name, "ekf"] <= 1.1 * value for name, value in reference.items()} == dict.fromkeys(
        reference, True
    )
