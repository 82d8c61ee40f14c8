"""A path loss that is known is found again, within the intervals told; standing still teaches nothing; poor input."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import LogError, RangeReading, Ranges, RssiReading, WifiScan
from fusion.radio import PathLoss
from logs.truth import TruthTrack
from sensors.calibration.line import fit_line
from sensors.calibration.place_medians import place_medians
from sensors.calibration.radio import calibrate_radio, kinds_in
from sensors.calibration.readings_by_place import gather, places
from sensors.cli.calibrate_radio import findings

AT = np.array([[0.0, 0.0, 2.0], [12.0, 0.0, 2.0], [6.0, 9.0, 2.0]])
N, LEVEL = 2.4, -38.0


def floor(seed, count=40):
    return np.random.default_rng(seed).uniform((0.5, 0.5), (11.5, 8.5), (count, 2))


def expected(points, n=N, level=LEVEL):
    away = np.sqrt(np.square(points[:, None] - AT[None, :, :2]).sum(axis=2) + 4.0)
    return PathLoss(path_loss_exponent=n, reference_rssi_dbm=level).expected(away)


def shadowed(points, seed, std, length):
    """Gudmundson's field for each anchor, (n, anchors)."""
    away = np.hypot(*(np.subtract.outer(c, c) for c in points.T))
    root = np.linalg.cholesky(std**2 * np.exp(-away / length) + 1e-9 * np.eye(len(points)))
    return root @ np.random.default_rng(seed + 1000).normal(size=(len(points), len(AT)))


@pytest.mark.parametrize("length", [0.3, 2.0])
def test_intervals_hold_the_truth_as_often_as_they_say(rssi_run, length):
    held = []
    for seed in range(60):
        points = floor(seed)
        values = expected(points) + shadowed(points, seed, 4.0, length)
        line = calibrate_line(rssi_run(points, values, each=1))
        held += [line.gain_interval().holds(N)]
    assert np.mean(held) >= 0.88
    # ... and an interval that says nothing would hold it too.
    assert line.gain_interval().reach < 1.5


@pytest.mark.parametrize("length", [1.0, 2.0])
def test_world_is_told_over_what_path_shadowing_stays_alike(rssi_run, length):
    told = []
    for seed in range(15):
        points = floor(seed, 100)
        run = rssi_run(points, expected(points) + shadowed(points, seed, 4.0, length), each=1)
        told.append(calibrate_line(run).length_m)
    assert 0.5 * length < np.median(told) < 2.0 * length
    assert findings([run]).changes["radio"]["shadowing_length_m"] == told[-1]


def calibrate_line(run):
    """The line alone: scores of places left out and advice, which cost nine tenths of a calibration, are not wanted."""
    readings = gather([run], "rssi")
    return fit_line(place_medians(readings, run.world.anchors[0].radio.path_loss_exponent), len(readings.names))


def test_without_noise_the_line_is_exact(rssi_run):
    points = floor(0)
    found = calibrate_radio([rssi_run(points, expected(points))], "rssi")
    assert found.line.gain == pytest.approx(N)
    assert found.line.levels == pytest.approx([LEVEL] * 3)
    assert found.std < 1e-6


def test_standing_longer_at_the_same_places_narrows_nothing(rssi_run):
    points = floor(1)
    values = expected(points) + shadowed(points, 1, 4.0, 1.0)
    few, many = (calibrate_line(rssi_run(points, values, each=each)).gain_interval() for each in (1, 40))
    assert tuple(many) == pytest.approx(tuple(few))


def test_more_places_narrow_it(rssi_run):
    reach = []
    for count in (15, 120):
        points = floor(2, count)
        values = expected(points) + np.random.default_rng(2).normal(0.0, 4.0, (count, 3))
        reach.append(calibrate_line(rssi_run(points, values, each=1)).gain_interval().reach)
    assert reach[1] < 0.5 * reach[0]


def test_a_tenth_of_wild_readings_moves_little(rssi_run):
    points = floor(3, 80)
    values = expected(points) + np.random.default_rng(3).normal(0.0, 1.0, (80, 3))
    wild = values.copy()
    wild[::10] -= 30.0
    clean, spoiled = (calibrate_line(rssi_run(points, each)).gain for each in (values, wild))
    assert abs(spoiled - clean) < 0.1


@settings(max_examples=8)
@given(turned=st.floats(-3.0, 3.0))
def test_turning_the_floor_changes_nothing(rssi_run, turned):
    points = floor(4, 20)
    values = expected(points) + shadowed(points, 4, 4.0, 1.0)
    one, two = (calibrate_line(rssi_run(points, values, turned=each)) for each in (0.0, turned))
    assert tuple(two.gain_interval()) == pytest.approx(tuple(one.gain_interval()), rel=1e-6)
    assert two.levels == pytest.approx(one.levels)


def test_an_anchor_that_is_louder_gets_a_level_of_its_own(rssi_run):
    points = floor(5)
    values = expected(points) + np.random.default_rng(5).normal(0.0, 1.0, (40, 3)) + (0.0, 0.0, 8.0)
    found = findings([rssi_run(points, values)])
    levels = [found.anchors[name]["radio"]["reference_rssi_dbm"] for name in "abc"]
    assert levels == pytest.approx([LEVEL, LEVEL, LEVEL + 8.0], abs=2.0)
    assert found.changes["radio"]["path_loss_exponent"] == pytest.approx(N, abs=0.3)


def test_places_left_out_are_told_better_than_by_a_wrong_world(rssi_run):
    points = floor(6, 60)
    values = expected(points) + np.random.default_rng(6).normal(0.0, 2.0, (60, 3))
    scores = calibrate_radio([rssi_run(points, values)], "rssi").scores
    rms = {score.what: score for score in scores}["block of places left out: reading, rms"]
    assert rms.before > 10.0
    assert rms.after == pytest.approx(2.0, abs=0.4)


def test_a_place_that_is_left_out_was_not_fitted(rssi_run):
    """One place 40 dB off: its own error stays what it is, whatever is fitted."""
    points = floor(7, 12)
    values = expected(points)
    values[3] += 40.0
    scores = {score.what: score for score in calibrate_radio([rssi_run(points, values)], "rssi").scores}
    assert scores["place left out: reading, rms"].after == pytest.approx(40.0 / math.sqrt(12), rel=0.05)


def test_the_next_place_is_where_none_was(rssi_run):
    """All places are some metres away: what is wanted is near, or far, and each one narrows the exponent."""
    angles = np.linspace(0.0, 2.0 * math.pi, 30, endpoint=False)
    radius = np.where(np.arange(30) % 2, 4.0, 5.0)
    points = np.column_stack([6.0 + radius * np.cos(angles), 3.0 + 0.2 * radius * np.sin(angles)])
    values = expected(points) + np.random.default_rng(8).normal(0.0, 3.0, (30, 3))
    found = calibrate_radio([rssi_run(points, values)], "rssi")
    told = found.readings.distance_m
    assert all(
        each.distance_m < np.quantile(told, 0.1) or each.distance_m > np.quantile(told, 0.9) for each in found.advice
    )
    stds = [found.line.gain_interval().std, *(each.gain_std for each in found.advice)]
    assert stds == sorted(stds, reverse=True)


def test_ranges_have_scale_and_offset(rssi_run):
    """UWB that reads 5 % and 30 cm long, through the same verb."""
    points = floor(9, 50)
    run = rssi_run(points, np.zeros((50, 3)))
    away = np.sqrt(np.square(points[:, None] - AT[None, :, :2]).sum(axis=2) + 4.0)
    noise = np.random.default_rng(9).normal(0.0, 0.1, (250, 3))
    told = tuple(
        Ranges(
            scan.time_ns,
            "uwb",
            i,
            tuple(
                RangeReading(name, float(1.05 * away[i // 5, k] + 0.3 + noise[i, k])) for k, name in enumerate("abc")
            ),
        )
        for i, scan in enumerate(run.measurements)
    )
    ranged = dataclasses.replace(run, measurements=told)
    assert kinds_in([ranged]) == ["range"]
    found = calibrate_radio([ranged], "range")
    assert found.line.gain_interval().holds(1.05)
    assert found.line.level_interval().holds(0.3)
    assert found.line.level_interval().reach < 0.1
    assert findings([ranged]).changes["ranging"]["scale"] == pytest.approx(1.05, abs=0.01)
    assert "shadowing_length_m" not in findings([ranged]).changes["ranging"]


def test_surveyed_points_do_without_truth(rssi_run, tmp_path):
    points = floor(10)
    run = rssi_run(points, expected(points))
    rows = [f"{5 * i - 0.1},{5 * i + 4.1},{x},{y}" for i, (x, y) in enumerate(points)]
    path = tmp_path / "points.csv"
    path.write_text("\n".join(["from_s,until_s,x_m,y_m", *rows]))
    found = calibrate_radio([dataclasses.replace(run, truth=None)], "rssi", path)
    assert found.line.gain == pytest.approx(N)


def test_one_anchor_is_enough_for_its_own_line(rssi_run):
    points = floor(11)
    run = rssi_run(points, expected(points)[:, :1], world=[{"id": "a", "position_m": [0.0, 0.0, 2.0]}])
    assert calibrate_line(run).gain == pytest.approx(N)


def test_places_are_visited_again_and_keep_their_number():
    found, radius = places(np.array([0.0, 0.4, 3.0, 0.1]), np.zeros(4), 1.0)
    assert (found.tolist(), radius) == ([0, 0, 1, 0], 1.0)


def test_readings_that_are_no_numbers_are_left_out(rssi_run):
    points = floor(12)
    values = expected(points)
    values[::4, 0] = math.nan
    found = calibrate_radio([rssi_run(points, values)], "rssi")
    assert found.line.gain == pytest.approx(N)
    assert (found.readings.anchor == 0).sum() == 30 * 5


def test_anchors_received_seldom_are_reported(rssi_run):
    points = floor(13)
    run = rssi_run(points, expected(points))
    deaf = tuple(
        dataclasses.replace(scan, readings=scan.readings[1:]) if i % 2 else scan
        for i, scan in enumerate(run.measurements)
    )
    remarks = findings([dataclasses.replace(run, measurements=deaf)]).remarks
    assert any("a was received in 50 % of the scans" in remark for remark in remarks)
    assert not any("b was received" in remark for remark in remarks)


def test_a_slope_that_cannot_be_told_from_the_level_is_warned_of(rssi_run):
    angles = np.linspace(0.0, 6.0, 12)
    points = np.column_stack([4.0 * np.cos(angles), 4.0 * np.sin(angles)]) * np.linspace(0.97, 1.03, 12)[:, None]
    values = expected(points)[:, :1] + np.random.default_rng(14).normal(0.0, 3.0, (12, 1))
    run = rssi_run(points, values, world=[{"id": "a", "position_m": [0.0, 0.0, 2.0]}])
    assert any("can hardly be separated" in remark for remark in findings([run]).remarks)


def test_poor_runs_are_refused_with_the_remedy(rssi_run):
    points = floor(15)
    run = rssi_run(points, expected(points))
    with pytest.raises(LogError, match="holds no ground truth"):
        calibrate_radio([dataclasses.replace(run, truth=None)], "rssi")
    with pytest.raises(LogError, match="holds no radio readings"):
        findings([dataclasses.replace(run, measurements=())])
    with pytest.raises(LogError, match="are too few"):
        calibrate_radio([rssi_run(points[:1], expected(points[:1]))], "rssi")
    strange = tuple(WifiScan(m.time_ns, "w", m.seq, (RssiReading("zz", -50.0),)) for m in run.measurements)
    with pytest.raises(LogError, match="no rssi readings of the world's anchors"):
        calibrate_radio([dataclasses.replace(run, measurements=strange)], "rssi")


def test_all_points_at_one_distance_are_refused(rssi_run):
    angles = np.linspace(0.0, 6.0, 12)
    ring = np.column_stack([4.0 * np.cos(angles), 4.0 * np.sin(angles)])
    run = rssi_run(ring, np.full((12, 1), -50.0), world=[{"id": "a", "position_m": [0.0, 0.0, 2.0]}])
    with pytest.raises(LogError, match=r"at one distance.*go nearer"):
        calibrate_radio([run], "rssi")


def test_readings_outside_the_truth_are_not_used(rssi_run):
    points = floor(16)
    run = rssi_run(points, expected(points))
    kept = run.truth.time_ns < 100 * 10**9
    cut = TruthTrack(*(column[kept] for column in (run.truth.time_ns, run.truth.x, run.truth.y, run.truth.heading)))
    assert len(gather([dataclasses.replace(run, truth=cut)], "rssi").value) == 100 * 3
