"""`fusion info`: what is in a log, in words and as JSON."""

import json

import pytest

from fusion import Covariance, Gyro, Pose, Prior, RangeReading, Ranges, World
from fusion.cli import main
from logs.info import describe
from logs.writer import RunWriter

SECOND = 1_000_000_000
WORLD = World.from_table({"name": "here", "bounds": {"x_min": 0, "x_max": 1, "y_min": 0, "y_max": 1}})
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
    assert "longest gap 2.00 s, 1 out of order" in text
    assert "truth: none" in text
    assert "start: position unknown, heading 28.6°" in text


def test_cut_off_log_is_described_with_its_warning(log, capsys):
    log.write_bytes(log.read_bytes()[:-100])
    assert main(["info", str(log)]) == 0
    assert "warning: " in capsys.readouterr().out


def test_file_that_is_no_log_is_one_sentence_and_exit_1(tmp_path, capsys):
    (tmp_path / "odd.mcap").write_text("hello")
    assert main(["info", str(tmp_path / "odd.mcap")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "is no MCAP file" in line


def test_foreign_bag_is_told_topic_by_topic_with_the_roles_each_could_play(tmp_path, ros, capsys):
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


def test_foreign_bag_cut_off_is_told_with_what_cannot_be_read(tmp_path, ros, capsys):
    (file,) = ros.bag(tmp_path / "walk", [("/imu", SECOND, ros.imu(SECOND, 0.5))]).glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-30])
    assert main(["info", str(file)]) == 0
    assert "warning: " in capsys.readouterr().out
