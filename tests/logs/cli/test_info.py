"""`fusion info`: what is in a log, in words and as JSON."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

import fusion
from fusion import (
    Covariance,
    Estimate,
    Gyro,
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
from logs.timing import JUMP_MESSAGES, JUMP_NS, Stream
from logs.writer import RunWriter
from tests.worlds import anchored_world, empty_world

SECOND = 1_000_000_000
WORLD = empty_world(name="here")
GYRO_S = (0, 1, 2, 5, 3)
"""Times in the order of their arrival: the last one is late."""


@pytest.fixture
def log(tmp_path):
    prior = Prior(0, Pose(1.0, 2.0, 0.5), Covariance.from_std(1, 1, 1), position_known=False)
    with RunWriter(tmp_path / "run.mcap", WORLD, name="walk", prior=prior) as writer:
        for arrival, time_s in enumerate(GYRO_S):
            writer.write(Gyro(time_s * SECOND, "g", arrival, 0.0), log_time_ns=(10 + arrival) * SECOND)
        writer.write(Ranges(SECOND, "uwb", 0, (RangeReading("a", 1.0),)))
    return tmp_path / "run.mcap"


def test_rates_gaps_and_late_stamps_are_those_of_the_channel(log):
    gyro, ranges = describe(log)["channels"]
    assert (gyro["count"], gyro["rate_hz"], gyro["longest_gap_s"], gyro["out_of_order"]) == (5, 0.8, 2.0, 1)
    assert (ranges["count"], ranges["rate_hz"], ranges["longest_gap_s"]) == (1, None, 0.0)
    assert describe(log)["duration_s"] == 5.0


def test_json_holds_the_same_as_the_function(log, capsys):
    assert main(["info", str(log), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == describe(log)


def test_text_names_world_hash_late_stamps_and_what_is_missing(log, capsys):
    assert main(["info", str(log)]) == 0
    text = capsys.readouterr().out
    assert WORLD.hash[:12] in text
    assert "longest gap 2.00 s, 1 out of order, 10.000 s late, at most 11.000 s" in text
    assert "truth: none" in text
    assert "start: position unknown, heading 28.6°" in text


@pytest.mark.parametrize(
    ("headings", "words"),
    [
        ((0.5, 0.5), "2 poses"),
        ((0.5, None), "2 poses, the heading known at 1 of them"),
        ((None, math.nan), "2 poses, the heading known at none of them"),
    ],
)
def test_true_headings_are_counted(tmp_path, capsys, headings, words):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="walk") as writer:
        writer.write(Gyro(0, "g", 0, 0.0))
        for i, heading in enumerate(headings):
            writer.write_truth(Truth(i, 1.0, 2.0, heading))
    assert main(["info", str(tmp_path / "run.mcap")]) == 0
    assert f"truth: {words}\n" in capsys.readouterr().out


def test_cut_off_log_is_described_with_its_warning(log, capsys):
    log.write_bytes(log.read_bytes()[:-100])
    assert main(["info", str(log)]) == 0
    assert "warning: " in capsys.readouterr().out


def test_file_that_is_no_log_is_one_sentence_and_exit_1(tmp_path, capsys):
    (tmp_path / "odd.mcap").write_text("hello")
    assert main(["info", str(tmp_path / "odd.mcap")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "is no MCAP file" in line


def test_foreign_bag_is_described_topic_by_topic_with_the_roles_each_could_play(tmp_path, ros, capsys):
    rows = [("/odom", t * SECOND, ros.odometry(t * SECOND, 0.0, 0.0, 0.0)) for t in range(5)]
    rows += [
        (
            "/tf",
            SECOND,
            ros.transforms((SECOND, "map", "odom", 0.0, 0.0, 0.0), (SECOND, "odom", "base", 0.0, 0.0, 0.0)),
        ),
        ("/uwb", 2 * SECOND, ros.range(2 * SECOND, "a", 1.0)),
        ("/uwb", 4 * SECOND, ros.range(4 * SECOND, "b", 1.0)),
        ("/chatter", SECOND, ros.make("std_msgs/msg/String", "hello")),
    ]
    bag = ros.bag(tmp_path / "walk", rows)
    about = describe(bag)
    odom, tf, uwb, chatter = about["topics"]
    assert (about["name"], about["duration_s"], about["warnings"]) == ("walk", 4.0, [])
    assert (odom["type"], odom["count"], odom["rate_hz"]) == ("nav_msgs/msg/Odometry", 5, 1.0)
    assert (odom["roles"], tf["roles"], uwb["roles"], chatter["roles"]) == (["odom", "truth"], ["truth"], ["range"], [])
    assert (tf["names"], uwb["names"]) == (["map>odom", "odom>base"], ["a", "b"])
    assert (uwb["rate_hz"], tf["rate_hz"]) == (0.5, None)
    (file,) = bag.glob("*.mcap")
    assert main(["info", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["topics"] == about["topics"]
    assert main(["info", str(bag)]) == 0
    text = capsys.readouterr().out
    assert "could be odom or truth" in text
    assert "(map>odom, odom>base)" in text
    assert "fusion import rosbag" in text


def test_foreign_bag_cut_off_is_described_with_what_cannot_be_read(tmp_path, ros, capsys):
    (file,) = ros.bag(tmp_path / "walk", [("/imu", SECOND, ros.imu(SECOND, 0.5))]).glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-30])
    assert main(["info", str(file)]) == 0
    assert "warning: " in capsys.readouterr().out


def stream(stamps, delays, numbers=None):
    stamps = np.array(stamps, dtype=np.int64)
    arrivals = stamps + np.array(delays, dtype=np.int64)
    return Stream(stamps, arrivals, np.arange(len(stamps)) if numbers is None else np.array(numbers))


@settings(derandomize=True)
@given(st.integers(2 * JUMP_MESSAGES, 60), st.lists(st.integers(0, JUMP_NS // 2), min_size=60, max_size=60))
def test_regular_stream_with_any_small_delay_has_nothing_odd(count, delays):
    timing = stream([i * SECOND for i in range(count)], delays[:count]).timing(0)
    assert (timing["rate_hz"], timing["period_s"], timing["gaps"], timing["longest_gap_s"]) == (1.0, 1.0, 0, 1.0)
    assert (timing["duplicates"], timing["out_of_order"], timing["clock_jumps"]) == (0, 0, [])
    assert timing["latest_s"] == max(delays[:count]) / SECOND


@settings(derandomize=True)
@given(
    st.integers(4 + JUMP_MESSAGES, 50),
    st.sampled_from([-3600.0, -5.0, -0.2, 0.2, 5.0, 1e6]),
    st.lists(st.integers(0, JUMP_NS // 2), min_size=60, max_size=60),
)
def test_clock_jump_is_found_where_it_is_and_a_late_message_is_none(place, jump_s, delays):
    """The log time steps by ``jump_s`` before the message at ``place``; one well before comes half an hour late."""
    jumped = [delay + (round(jump_s * SECOND) if i >= place else 0) for i, delay in enumerate(delays)]
    jumped[3] += 1800 * SECOND
    ((at, by_ns),) = stream([i * SECOND for i in range(60)], jumped).jumps()
    assert at == place
    assert abs(by_ns - jump_s * SECOND) <= JUMP_NS / 2


def test_short_stream_has_no_jump():
    assert stream(range(19), [0] * 10 + [SECOND] * 9).jumps() == []


def test_gaps_are_counted_and_placed_and_twins_are_counted():
    timing = stream([0, 1, 2, 3, 10, 11, 12, 20, 20, 21], [0] * 10, [0, 1, 2, 3, 4, 5, 6, 7, 7, 8]).timing(0)
    assert (timing["gaps"], timing["duplicates"]) == (2, 1)
    assert (timing["longest_gap_s"], timing["longest_gap_at_s"]) == (8e-9, 12e-9)


def test_clock_of_the_recorder_that_is_set_back_is_reported_in_words(tmp_path, capsys):
    """It arrives a second late each time; the log time is set back by 15 s before number 20, and number 30 is lost."""
    path = tmp_path / "run.mcap"
    with RunWriter(path, WORLD, name="back") as writer:
        for number in (*range(30), *range(34, 50), 49):
            log_s = 31 + number - (15 if number >= 20 else 0)
            writer.write(Gyro((30 + number) * SECOND, "g", number, 0.0), log_time_ns=log_s * SECOND)
    (gyro,) = describe(path)["channels"]
    assert gyro["clock_jumps"] == [{"at_s": 20.0, "by_s": -15.0}]
    assert gyro["log_time_backwards"] == 1
    assert main(["info", str(path)]) == 0
    text = capsys.readouterr().out
    assert "longest gap 5.00 s at 29.0 s, gaps of over 3 periods: 1, " in text
    assert ", 1 twice, " in text
    assert "clock jump at 20.0 s: its delay changes by -15.00 s, times that the log time runs backwards: 1" in text


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


def test_several_files_are_described_and_one_that_is_none_does_not_hide_the_others(tmp_path, log, capsys):
    other = drive(tmp_path / "drive.mcap")
    (tmp_path / "odd.mcap").write_text("hello")
    assert main(["info", str(log), str(other), "--json"]) == 0
    assert [about["name"] for about in json.loads(capsys.readouterr().out)] == ["walk", "drive"]
    assert main(["info", str(log), str(tmp_path / "odd.mcap"), str(other)]) == 1
    out, err = capsys.readouterr()
    assert out.index("walk: ") < out.index("drive: ")
    assert "is no MCAP file" in err


def test_json_of_a_damaged_log_holds_what_repair_would_state(tmp_path, log, capsys):
    with log.open("rb") as stream:
        last = make_reader(stream).get_summary().chunk_indexes[-1]
    log.write_bytes(log.read_bytes()[: last.chunk_start_offset + 30])
    damage = describe(log)["damage"]
    assert main(["repair", str(log), "-o", str(tmp_path / "good.mcap"), "--json"]) == 3
    assert damage.items() <= json.loads(capsys.readouterr().out).items()


def parts_of(folder, *recordings):
    for number, recording in enumerate(recordings):
        about = {} if recording is None else {"recording": recording, "split": str(number)}
        with RunWriter(folder / f"part-{number}.mcap", WORLD, name=f"part-{number}", metadata=about) as writer:
            writer.write(Gyro(SECOND, "g", 1, 0.0))


def test_folder_of_logs_is_each_log_in_it(tmp_path, capsys):
    parts_of(tmp_path, "a", "a")
    (tmp_path / "part-2.mcap").write_text("cut to nothing")
    assert main(["info", str(tmp_path)]) == 1
    out, err = capsys.readouterr()
    assert "not a log of fusion" not in out
    assert out.index("part-0: ") < out.index("part-1: ")
    assert out.endswith(f"\nparts of one recording; one log of them: fusion join {tmp_path} -o RUN.mcap\n")
    assert "part-2.mcap: is no MCAP file" in err


@pytest.mark.parametrize("recordings", [("a", "b"), (None, None), ("a",)])
def test_only_parts_of_one_recording_are_to_be_joined(tmp_path, recordings, capsys):
    parts_of(tmp_path, *recordings)
    assert main(["info", str(tmp_path)]) == 0
    assert "fusion join" not in capsys.readouterr().out


def test_json_of_a_folder_of_logs_is_a_list_even_of_one(tmp_path, capsys):
    parts_of(tmp_path, "a")
    assert main(["info", str(tmp_path), "--json"]) == 0
    assert [about["name"] for about in json.loads(capsys.readouterr().out)] == ["part-0"]
