"""`fusion info`: what is in a log, in words and as JSON."""

import json
import math

import pytest
from mcap.reader import make_reader

from fusion import (
    Covariance,
    Gyro,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    Truth,
)
from fusion.cli.main import main
from logs.cli.info import describe
from logs.writer import RunWriter
from tests.worlds import empty_world

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


def test_several_files_are_described_and_one_that_is_none_does_not_hide_the_others(tmp_path, log, capsys):
    parts_of(tmp_path, "a")
    other = tmp_path / "part-0.mcap"
    (tmp_path / "odd.mcap").write_text("hello")
    assert main(["info", str(log), str(other), "--json"]) == 0
    assert [about["name"] for about in json.loads(capsys.readouterr().out)] == ["walk", "part-0"]
    assert main(["info", str(log), str(tmp_path / "odd.mcap"), str(other)]) == 1
    out, err = capsys.readouterr()
    assert out.index("walk: ") < out.index("part-0: ")
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
