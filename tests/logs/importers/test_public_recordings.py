"""Foreign recordings: dead reckoning over the imported log agrees with the figures published beside the data."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from fusion import Increment, Odometry, PluginError, Ranges, RecordingError, WifiScan
from logs.cli.import_ import import_recordings
from logs.reader import read_run

DATA = Path(__file__).resolve().parents[3].parent / "shared" / "data"
FOLDERS = {
    "tuc": "tuc_labyrinth_uwb",
    "plaza": "plaza",
    "cdoa": "herolab_cdoa_wifi",
    "kolakowski": "kolakowski_ble",
    "haiyao": "haiyao_wifi_rtt",
}
DEAD_RECKONING = {
    # RMSE, maximum, final error [m]: the READMEs' tables
    ("tuc", "Indoor_UWB"): (0.064, 0.137, 0.070),
    ("plaza", "Plaza1"): (1.935, 4.449, 4.449),
    ("cdoa", "trial-exp2"): (0.577, 1.213, 1.213),
    ("cdoa", "trial-exp3"): (0.484, 1.283, 0.654),
    ("cdoa", "trial-exp4"): (0.444, 0.924, 0.459),
    ("cdoa", "trial1-exp2.1"): (0.870, 1.656, 0.760),
    ("cdoa", "trial1-exp3.1"): (1.632, 3.678, 1.467),
    ("cdoa", "trial1-exp4.1"): (0.411, 0.666, 0.547),
    ("kolakowski", "calib1"): (2.791, 5.693, 3.073),
    ("kolakowski", "calib2"): (2.562, 6.200, 2.672),
    ("kolakowski", "calib3"): (0.996, 4.628, 4.625),
}
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the public recordings are not on this machine")


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """Every kind's runs by kind and name, each kind imported once."""
    kept = {}

    def runs(kind):
        if kind not in kept:
            paths = import_recordings(kind, DATA / FOLDERS[kind], tmp_path_factory.mktemp(kind))
            kept[kind] = {run.name: run for run in map(read_run, paths)}
        return kept[kind]

    return runs


def dead_reckoning_errors(run):
    motion, times, path = Increment(), [run.prior.time_ns], [run.prior.pose]
    for odometry in (m for m in run.measurements if isinstance(m, Odometry)):
        motion = motion.extend(odometry, run.world.robot.noise)
        times.append(odometry.time_ns)
        path.append(run.prior.pose.compose(motion.pose))
    x = np.interp(run.truth.time_ns, times, [pose.x for pose in path])
    y = np.interp(run.truth.time_ns, times, [pose.y for pose in path])
    return np.hypot(x - run.truth.x, y - run.truth.y)


@needs_data
@pytest.mark.parametrize(("kind", "name"), DEAD_RECKONING)
def test_dead_reckoning_agrees_with_the_published_figure(imported, kind, name):
    errors = dead_reckoning_errors(imported(kind)[name])
    measured = (math.sqrt(np.mean(errors**2)), errors.max(), errors[-1])
    assert measured == pytest.approx(DEAD_RECKONING[kind, name], rel=0.1)


@needs_data
@pytest.mark.parametrize(("kind", "count"), [("tuc", 1), ("plaza", 1), ("cdoa", 7), ("kolakowski", 3), ("haiyao", 8)])
def test_every_run_is_found_in_time_order_and_states_where_its_numbers_come_from(imported, kind, count):
    runs = imported(kind)
    assert len(runs) == count
    for run in runs.values():
        times = [measurement.time_ns for measurement in run.measurements]
        assert times == sorted(times)
        assert run.prior.time_ns <= times[0]
        assert "in-sample" in run.world.provenance
        assert not run.warnings
        assert run.metadata["prior"]


@needs_data
def test_row_cut_off_at_the_end_is_skipped_and_counted(imported):
    assert imported("cdoa")["trial-exp3"].metadata["skipped"].startswith("1 row")
    assert "skipped" not in imported("cdoa")["trial-exp2"].metadata


@needs_data
def test_third_ble_run_ends_where_the_publication_ends_it(imported):
    run = imported("kolakowski")["calib3"]
    assert len(run.truth) == 490
    assert run.truth.time_ns[-1] == 1628001747456333000


@needs_data
def test_true_heading_of_the_ble_runs_points_along_the_direction_of_travel(imported):
    truth = imported("kolakowski")["calib1"].truth
    dx, dy = np.diff(truth.x), np.diff(truth.y)
    fast = np.hypot(dx, dy) > 0.08
    offset = np.exp(1j * (np.arctan2(dy, dx) - truth.heading[:-1]))[fast]
    assert abs(np.angle(np.median(offset.real) + 1j * np.median(offset.imag))) < 0.1


@needs_data
def test_unanswered_ranges_are_left_out_and_real_outliers_kept(imported):
    runs = imported("haiyao").values()
    ranges = [r.range_m for run in runs for m in run.measurements if isinstance(m, Ranges) for r in m.readings]
    assert len(ranges) == 39756  # the README's count
    assert 0.0 not in ranges
    assert sum(far > 100.0 for far in ranges) == 3
    assert any(isinstance(m, WifiScan) for run in runs for m in run.measurements)


@needs_data
def test_calibrated_ranges_are_unbiased_on_the_run_they_were_calibrated_on(imported):
    for kind, name, spread_m in (("tuc", "Indoor_UWB", 0.107), ("plaza", "Plaza1", 0.505)):
        run = imported(kind)[name]
        errors = []
        for scan in (m for m in run.measurements if isinstance(m, Ranges)):
            (reading,) = scan.readings
            anchor = run.world.anchor(reading.anchor)
            x = np.interp(scan.time_ns, run.truth.time_ns, run.truth.x)
            y = np.interp(scan.time_ns, run.truth.time_ns, run.truth.y)
            errors.append(float(anchor.ranging.distance(reading.range_m)) - math.hypot(anchor.x - x, anchor.y - y))
        assert abs(np.mean(errors)) < 0.01
        assert np.std(errors) == pytest.approx(spread_m, rel=0.1)


@needs_data
def test_one_file_is_refused_where_the_folder_holds_several_runs(tmp_path):
    with pytest.raises(RecordingError, match="holds 3 runs"):
        import_recordings("kolakowski", DATA / FOLDERS["kolakowski"], tmp_path / "one.mcap")


@needs_data
@pytest.mark.parametrize(
    ("old", "new"),
    [("range2 0.127943992614746", "range2 noon"), (" 105 0", ""), ("odom2diff 0.127943992614746", "odom2diff x")],
)
def test_malformed_row_is_refused_with_file_and_line(tmp_path, old, new):
    source = tmp_path / "set"
    shutil.copytree(DATA / FOLDERS["tuc"], source)
    path = source / "Indoor_UWB_Input.txt"
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"Indoor_UWB_Input\.txt:\d+"):
        import_recordings("tuc", source, tmp_path / "out")


@pytest.mark.parametrize("kind", FOLDERS)
def test_folder_without_such_files_is_refused(tmp_path, kind):
    with pytest.raises(RecordingError, match="no "):
        import_recordings(kind, tmp_path, tmp_path / "out")


def test_unknown_kind_is_answered_with_the_nearest():
    with pytest.raises(PluginError, match="no importer named 'plazza' is installed; did you mean 'plaza'"):
        import_recordings("plazza", Path(), Path("out"))


@needs_data
def test_ble_run_without_commands_is_a_run_without_odometry(tmp_path):
    source = tmp_path / "set"
    shutil.copytree(DATA / FOLDERS["kolakowski"], source)
    for path in source.rglob("*_motion.txt"):
        path.unlink()
    run = read_run(import_recordings("kolakowski", source, tmp_path / "out")[2])
    assert run.world.robot.drive == "none"
    assert not any(isinstance(measurement, Odometry) for measurement in run.measurements)
