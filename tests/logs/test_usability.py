"""Usability of a log for each installed estimator, as `fusion info` shows it."""

import numpy as np

import fusion
from fusion import (
    Covariance,
    Estimate,
    Odometry,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    Tag,
    Truth,
    WifiScan,
    registered,
)
from fusion.cli.main import main
from logs.cli.info import describe
from logs.writer import RunWriter
from tests.worlds import anchored_world

SECOND = 1_000_000_000
ANCHORED = anchored_world({"a": (0, 0), "b": (9, 0), "c": (0, 9)}, name="here")
KNOWN = Prior(0, Pose(3.0, 3.0, 0.0), Covariance.from_std(0.1, 0.1, 0.1))
SPEED_M_S = 0.1


def drive(path, *, prior=KNOWN, odometry=True, anchors="abc", truth=()):
    """Three seconds in a straight line, a range to each of the anchors every half second."""
    with RunWriter(path, ANCHORED, name="drive", prior=prior) as writer:
        for number in range(1, 31):
            time_ns, x = number * SECOND // 10, 3.0 + SPEED_M_S * number / 10
            if odometry:
                writer.write(Odometry(time_ns, "odo", number, time_ns - SECOND // 10, SPEED_M_S / 10, 0.0))
            if number % 5 == 0 and anchors:
                ranges = {"a": np.hypot(x, 3.0), "b": np.hypot(9.0 - x, 3.0), "c": np.hypot(x, 6.0), "z": 1.0}
                readings = tuple(RangeReading(anchor, float(ranges[anchor]), 0.1) for anchor in anchors)
                writer.write(Ranges(time_ns, "uwb", number, readings))
        for pose in truth:
            writer.write_truth(pose)
    return path


def verdicts(path):
    return {row["estimator"]: row for row in describe(path)["usability"]}


def test_every_installed_estimator_can_use_a_full_log(tmp_path):
    rows = verdicts(drive(tmp_path / "run.mcap"))
    assert tuple(rows) == fusion.available()
    assert {name for name, row in rows.items() if not row["usable"]} == set()
    assert (rows["ekf"]["readings"], rows["ekf"]["used"]) == (18, 18)


def test_estimator_that_is_not_installed_is_reported_once(stranger, tmp_path, capsys):
    path = drive(tmp_path / "run.mcap")
    assert {"lacking_one", "lacking_two"}.isdisjoint(verdicts(path))
    assert main(["info", str(path)]) == 0
    assert f"  lacking_one, lacking_two: {stranger}\n" in capsys.readouterr().out


def test_what_is_missing_is_named_estimator_by_estimator(tmp_path, capsys):
    rows = verdicts(drive(tmp_path / "blind.mcap", prior=None))
    assert rows["particle"]["usable"]
    assert rows["ekf"]["lacks"] == ["the start position is unknown"]
    assert rows["bayes_weight"]["lacks"] == ["the start heading is unknown"]
    rows = verdicts(drive(tmp_path / "deaf.mcap", anchors=""))
    assert rows["dead_reckoning"]["usable"]
    assert rows["ekf"]["lacks"] == ["no radio readings"]
    rows = verdicts(drive(tmp_path / "still.mcap", odometry=False))
    assert rows["dead_reckoning"]["lacks"] == ["no odometry"]
    rows = verdicts(drive(tmp_path / "two.mcap", anchors="ab"))
    assert rows["radio_only"]["lacks"] == ["no reading of the replay enters it"]
    assert rows["radio_only"]["refused"] == {"too_few_anchors": 12}
    assert main(["info", str(tmp_path / "two.mcap")]) == 0
    text = capsys.readouterr().out
    assert "radio_only              no   no reading of the replay enters it; 0 of 12 readings used, 12 too" in text
    assert "never received: c" in text


def test_truth_gives_a_start_where_the_log_has_none_of_its_own(tmp_path):
    rows = verdicts(drive(tmp_path / "run.mcap", prior=None, truth=[Truth(SECOND, 3.1, 3.0, 0.0)]))
    assert rows["ekf"]["usable"]
    rows = verdicts(drive(tmp_path / "other.mcap", prior=None, truth=[Truth(SECOND, 3.1, 3.0)]))
    assert rows["ekf"]["usable"]
    assert rows["dead_reckoning"]["lacks"] == ["the start heading is unknown"]


def test_readings_of_unknown_anchors_are_counted_and_refused(tmp_path, capsys):
    path = drive(tmp_path / "run.mcap", anchors="abcz")
    about = describe(path)
    assert (about["readings"], about["unknown_anchors"]) == ({"a": 6, "b": 6, "c": 6}, {"z": 6})
    assert verdicts(path)["ekf"]["refused"] == {"unknown_anchor": 6}
    assert main(["info", str(path)]) == 0
    assert "readings of what is no anchor of the world: z (6)" in capsys.readouterr().out


class Stubborn:
    """Uses signal strengths only, and falls over the second one."""

    summary, tags = "for this test", frozenset({Tag.GLOBAL_START, Tag.NO_HEADING})

    def __init__(self, world):
        pass

    def start(self, prior, seed):
        return 0

    def step(self, state, motion, scan):
        if isinstance(scan, WifiScan):
            return state + 1, (1 / (1 - state),)
        return state, ()

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, Pose(0.0, 0.0, 0.0), None)


class Broken(Stubborn):
    """Cannot even start."""

    def start(self, prior, seed):
        raise KeyError("start")


def test_radio_that_begins_late_is_replayed_all_the_same(tmp_path):
    with RunWriter(tmp_path / "run.mcap", ANCHORED, name="late", prior=KNOWN) as writer:
        for number in range(1, 2200):
            time_ns = number * SECOND // 100
            writer.write(Odometry(time_ns, "odo", number, time_ns - SECOND // 100, 0.0, 0.0))
        writer.write(Ranges(22 * SECOND, "uwb", 1, (RangeReading("a", float(np.hypot(3.0, 3.0))),)))
    row = verdicts(tmp_path / "run.mcap")["ekf"]
    assert (row["usable"], row["readings"], row["used"]) == (True, 1, 1)


def test_estimator_that_fails_on_the_log_is_listed_with_its_error(tmp_path):
    path = tmp_path / "run.mcap"
    with RunWriter(path, ANCHORED, name="test", prior=KNOWN) as writer:
        for number in range(1, 4):
            writer.write(WifiScan(number * SECOND, "wifi", number, (RssiReading("a", -50.0),)))
    with registered("stubborn", Stubborn), registered("broken", Broken):
        rows = verdicts(path)
    assert not rows["stubborn"]["usable"]
    assert "ZeroDivisionError" in rows["stubborn"]["lacks"][0]
    assert "Broken failed at its start: KeyError('start')" in rows["broken"]["lacks"][0]
