"""A bag of somebody else's robot becomes a run: every role, every type, and what is refused."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
import tomlkit

from fusion import Gyro, LogError, RangeReading, Ranges, RssiReading, WifiScan, World
from fusion.cli.main import main
from fusion.errors import ParameterError
from logs.cli.import_ import import_recordings
from logs.importers.rosbag import read_bag
from logs.reader import read_run
from tests.logs.importers.hall import GRAVITY, POSES, SECOND, TABLE, WORLD, of


def test_every_role_is_read_with_its_exact_numbers(tmp_path, ros, drive):
    run = read_bag(ros.bag(tmp_path / "walk", drive), WORLD, {"truth": "/mocap"})
    assert (run.name, run.world, run.warnings, dict(run.lanes)) == ("walk", WORLD, (), {})
    assert of(run, Gyro) == [Gyro(t * SECOND, "/imu/data", t - 1, 0.1 * t, GRAVITY) for t in range(1, 5)]
    assert of(run, Ranges) == [
        Ranges(2 * SECOND, "/uwb/a", 0, (RangeReading("a", 2.5),)),
        Ranges(2 * SECOND, "/uwb/b", 0, (RangeReading("b", 4.5),)),
    ]
    readings = (RssiReading("a", -40.5, 5), RssiReading("b", -60.0, 5))
    assert of(run, WifiScan) == [WifiScan(3 * SECOND, "/wifi", 0, readings)]
    assert run.truth.time_ns.tolist() == [t * SECOND for t, *_ in POSES]
    assert np.column_stack([run.truth.x, run.truth.y]).tolist() == [[x, y] for _, x, y, _ in POSES]
    assert run.truth.heading.tolist() == pytest.approx([heading for *_, heading in POSES], abs=1e-15)
    assert run.prior.pose == (0.0, 0.0, 0.0)
    assert run.metadata["topics"] == "truth=/mocap odom=/odom gyro=/imu/data wifi=/wifi range=/uwb/a range=/uwb/b"


def test_imu_that_measures_no_rate_is_counted(tmp_path, ros):
    rows = [("/imu", t * SECOND, ros.imu(t * SECOND, 0.5, measured=t == 2)) for t in range(1, 4)]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD)
    assert run.measurements == (Gyro(2 * SECOND, "/imu", 0, 0.5, GRAVITY),)
    assert "2 messages of /imu cannot be decoded" in run.warnings[0]


def test_variance_of_a_newer_range_is_its_spread_and_zero_is_none(tmp_path, newer_ros):
    rows = [
        ("/uwb", SECOND, newer_ros.range(SECOND, "a", 2.5, variance=0.25)),
        ("/uwb", 2 * SECOND, newer_ros.range(2 * SECOND, "b", math.inf, variance=0.0)),
    ]
    run = read_bag(newer_ros.bag(tmp_path / "bag", rows), WORLD)
    assert [scan.readings for scan in run.measurements] == [
        (RangeReading("a", 2.5, 0.5),),
        (RangeReading("b", math.inf, None),),
    ]


def test_our_own_ranges_keep_their_readings(tmp_path, ros):
    bag = ros.bag(tmp_path / "bag", [("/uwb", SECOND, ros.ranges(SECOND, a=1.5, c=2.5))])
    readings = (RangeReading("a", 1.5), RangeReading("c", 2.5))
    assert read_bag(bag, WORLD).measurements == (Ranges(SECOND, "/uwb", 0, readings),)
    with pytest.raises(ParameterError, match="is of the type fusion_msgs/msg/Ranges, and not sensor_msgs/msg/Range"):
        read_bag(bag, WORLD, {"range.a": "/uwb"})


@pytest.mark.parametrize("kind", ["pose", "pose_with_covariance", "odometry", "transforms"])
def test_truth_of_every_type_is_moved_into_the_map(tmp_path, ros, kind):
    heading = 0.25
    message = {
        "pose": lambda: ros.pose(SECOND, 1.0, 2.0, heading),
        "pose_with_covariance": lambda: ros.pose_with_covariance(SECOND, 1.0, 2.0, heading),
        "odometry": lambda: ros.odometry(SECOND, 1.0, 2.0, heading),
        "transforms": lambda: ros.transforms(
            (SECOND, "/map", "odom", 8.0, 8.0, 0.0),
            (SECOND, "map", "/base_link", 1.0, 2.0, heading),
            (SECOND, "map", "nan", math.nan, 2.0, heading),
        ),
    }[kind]()
    topic = "tf:map>base_link" if kind == "transforms" else "/truth"
    bag = ros.bag(tmp_path / "bag", [("/truth", 2 * SECOND, message)])
    run = read_bag(bag, WORLD, {"truth": topic}, truth_to_map=(10.0, 20.0, math.pi / 2))
    assert run.truth.time_ns.tolist() == [SECOND]
    assert (run.truth.x[0], run.truth.y[0]) == pytest.approx((8.0, 21.0), abs=1e-12)
    assert run.truth.heading[0] == pytest.approx(math.pi / 2 + heading, abs=1e-15)
    assert run.measurements == ()
    assert "holds no measurements" in run.warnings[-1]
    still = read_bag(bag, WORLD, {"truth": topic})
    assert (still.truth.x[0], still.truth.y[0], still.metadata["topics"]) == (1.0, 2.0, f"truth={topic}")


@pytest.mark.parametrize("unknown", [None, math.nan])
@pytest.mark.parametrize("kind", ["pose", "pose_with_covariance", "odometry", "transforms"])
def test_pose_without_rotation_is_truth_without_heading_row_by_row(tmp_path, ros, kind, unknown):
    def message(t, heading):
        if kind == "transforms":
            return ros.transforms((t * SECOND, "map", "base_link", 1.0 * t, 2.0, heading))
        return getattr(ros, kind)(t * SECOND, 1.0 * t, 2.0, heading)

    rows = [("/gt", t * SECOND, message(t, heading)) for t, heading in ((1, unknown), (2, 0.5), (3, unknown))]
    topic = "tf:map>base_link" if kind == "transforms" else "/gt"
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD, {"truth": topic, "odom": "none"})
    assert run.truth.x.tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(run.truth.heading).tolist() == [True, False, True]
    assert run.truth.heading[1] == pytest.approx(0.5, abs=1e-15)
    assert (run.prior.position_known, run.prior.heading_known) == (True, False)
    assert run.warnings == (f"{tmp_path / 'bag'}: holds no measurements",)


@pytest.mark.parametrize("frame", [(1.0, 2.0), (1.0, 2.0, math.nan)])
def test_frame_of_the_truth_that_is_none_is_refused(tmp_path, ros, drive, frame):
    with pytest.raises(ParameterError, match="are not three numbers"):
        read_bag(ros.bag(tmp_path / "bag", drive), WORLD, {"truth": "/mocap"}, truth_to_map=frame)


@pytest.mark.parametrize("topic", ["/odom", "/imu/data", "/mocap"])
def test_message_that_cannot_be_decoded_is_counted_and_the_others_are_read(tmp_path, ros, drive, topic):
    kind = next(message.__msgtype__ for name, _, message in drive if name == topic)
    rows = [*drive, (topic, 9 * SECOND, SimpleNamespace(type=kind, data=b"\x00\x01\x00\x00short"))]
    run = read_bag(ros.bag(tmp_path / "damaged", rows), WORLD, {"truth": "/mocap"})
    whole = read_bag(ros.bag(tmp_path / "whole", drive), WORLD, {"truth": "/mocap"})
    assert run.measurements == whole.measurements
    assert run.truth.time_ns.tolist() == whole.truth.time_ns.tolist()
    (warning,) = run.warnings
    assert f"1 messages of {topic} cannot be decoded" in warning


def test_pose_that_is_not_finite_is_no_truth(tmp_path, ros):
    rows = [("/gt", t * SECOND, ros.pose(t * SECOND, x, 0.0)) for t, x in ((1, 1.0), (2, math.nan), (3, 3.0))]
    run = read_bag(ros.bag(tmp_path / "bag", rows), WORLD, {"truth": "/gt"})
    assert run.truth.x.tolist() == [1.0, 3.0]
    assert any("1 of 3 true poses have no position, and are left out" in warning for warning in run.warnings)


def test_stamps_that_were_never_set_are_reported(tmp_path, ros):
    run = read_bag(ros.bag(tmp_path / "bag", [("/imu", t, ros.imu(0, 0.5)) for t in (1, 2)]), WORLD)
    assert "all messages of /imu carry one and the same stamp" in run.warnings[0]


def test_bag_cut_off_opens_with_a_warning_and_what_stands_before(tmp_path, ros, drive):
    (file,) = ros.bag(tmp_path / "bag", drive).glob("*.mcap")
    whole = read_bag(file, WORLD)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:-40])
    run = read_bag(cut, WORLD)
    assert run.measurements == whole.measurements
    assert "cut off or damaged" in run.warnings[0]


def test_files_of_a_split_recording_are_one_run_in_the_order_of_their_numbers(tmp_path, ros, drive):
    split = tmp_path / "split"
    split.mkdir()
    for number, row in ((10, drive[2]), (9, drive[1]), (8, drive[0])):
        (file,) = ros.bag(tmp_path / f"part{number}", [row]).glob("*.mcap")
        file.rename(split / f"split_{number}.mcap")
    whole = read_bag(ros.bag(tmp_path / "whole", drive[:3]), WORLD)
    assert read_bag(split, WORLD).measurements == whole.measurements


def test_bag_without_mcap_or_without_anything_of_use_is_refused(tmp_path, ros):
    with pytest.raises(LogError, match=re.escape("holds no *.mcap; convert the bag first")):
        read_bag(tmp_path, WORLD)
    bag = ros.bag(tmp_path / "bag", [("/chatter", 1, ros.make("std_msgs/msg/String", "hello"))])
    with pytest.raises(LogError, match="no message of it is of use"):
        read_bag(bag, WORLD)


def test_imported_bag_is_the_same_run(tmp_path, ros, drive):
    rows = [*drive, ("/imu/data", 9 * SECOND, ros.imu(SECOND + 5, 0.7))]  # a late one keeps its place
    bag = ros.bag(tmp_path / "walk", rows)
    (tmp_path / "world.toml").write_text(tomlkit.dumps(TABLE))
    world = World.load(tmp_path / "world.toml")
    options = {"topics": {"truth": "/mocap"}, "truth_to_map": (1.0, 2.0, 0.5)}
    (path,) = import_recordings("rosbag", bag, tmp_path / "out", world=tmp_path / "world.toml", **options)
    imported, read = read_run(path), read_bag(bag, world, options["topics"], truth_to_map=options["truth_to_map"])
    assert path.name == "walk.mcap"
    assert imported.measurements == read.measurements
    assert imported.measurements[-1].rate_rad_s == 0.7
    assert (imported.name, imported.world, imported.prior) == (read.name, read.world, read.prior)
    for column in ("time_ns", "x", "y"):
        assert getattr(imported.truth, column).tolist() == getattr(read.truth, column).tolist()
    assert imported.truth.heading.tolist() == pytest.approx(read.truth.heading.tolist(), abs=1e-15)  # a quaternion
    assert read.metadata.items() <= imported.metadata.items()
    assert imported.warnings == ()


def test_clock_of_the_log_may_be_another_than_that_of_the_stamps(tmp_path, ros, drive):
    unix_ns = 1_700_000_000 * SECOND
    bag = ros.bag(tmp_path / "bag", [(topic, unix_ns + log_ns, message) for topic, log_ns, message in drive])
    (tmp_path / "world.toml").write_text(tomlkit.dumps(TABLE))
    (path,) = import_recordings(
        "rosbag", bag, tmp_path / "run.mcap", world=tmp_path / "world.toml", topics={"truth": "/mocap"}
    )
    assert read_run(path).measurements == read_bag(bag, WORLD).measurements


def test_command_line_imports_a_bag_and_reports_what_is_doubtful(tmp_path, ros, drive, capsys):
    bag = ros.bag(tmp_path / "bag", drive)
    (tmp_path / "world.toml").write_text(tomlkit.dumps(TABLE))
    out = str(tmp_path / "run.mcap")
    words = ["import", "rosbag", str(bag), "--world", str(tmp_path / "world.toml"), "--topic", "odom=/odom", "-o", out]
    assert main(words) == 0
    reported = capsys.readouterr()
    assert reported.out == f"{out}\n"
    assert reported.err.startswith("warning: ")
    assert "it may be in /mocap" in reported.err
    assert read_run(tmp_path / "run.mcap").metadata["warnings"] in reported.err
    words += ["--topic", "truth=/mocap", "--truth-to-map", "1", "2", "0", "--force"]
    assert main(words) == 0
    assert not capsys.readouterr().err
    assert read_run(tmp_path / "run.mcap").truth.x.tolist() == [1.0 + x for _, x, _, _ in POSES]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["rosbag", "."], "give --world"),
        (["rosbag", ".", "--topic", "odom"], "names no topic; write ROLE=TOPIC"),
        (["rosbag", ".", "--topic", "odom=/a", "--topic", "odom=/b"], "odom is /a already"),
        (["csv", ".", "--topic", "odom=/odom"], "csv takes no topics"),
        (["rosbag", "missing.mcap", "--world", "w.toml"], "no such"),
    ],
)
def test_command_line_that_cannot_be_meant_is_one_sentence(tmp_path, monkeypatch, capsys, words, sentence):
    monkeypatch.chdir(tmp_path)
    assert main(["import", *words, "-o", "out.mcap"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert sentence in line
