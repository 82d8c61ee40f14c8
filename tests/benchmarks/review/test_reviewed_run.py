"""What a review can be of: a log of ours, anybody's bag, a run of a suite."""

import json
import math
import shlex
import shutil

import pytest
import tomlkit
from rosbags.typesys import Stores

from benchmarks.runner.run_source import content_of
from benchmarks.runner.store import Store
from benchmarks.runner.suite import RunSource
from fusion import WheelTicks, WifiScan
from fusion.cli.main import main
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulate, simulated_run
from tests.logs.importers.foreign_bags import Ros

EPOCH_NS = 1_700_000_000_000_000_000
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
SUITE = """
[suite]
name = "two"
[[runs]]
id = "mec"
scenario = "paper_mec"
duration_s = 20.0
[[runs]]
id = "walk"
mcap = "walk"
world = "world.toml"
topics = { truth = "/mocap" }
[[estimators]]
id = "ekf"
use = "ekf"
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the bag `walk` of a robot that knows nothing of us, its world, and a suite that names it."""
    folder, ros = tmp_path_factory.mktemp("subject"), Ros(Stores.ROS2_HUMBLE)
    run = simulated_run(load_scenario("paper_mec"), 1)
    (folder / "world.toml").write_text(tomlkit.dumps(json.loads(run.world.table)), encoding="utf-8")
    (folder / "suite.toml").write_text(SUITE, encoding="utf-8")
    stamped = [(EPOCH_NS + m.time_ns, m) for m in run.measurements if m.time_ns < 40_000_000_000]
    turn = math.tau / run.world.robot.ticks_per_revolution
    rows = [
        ("/joints", t, ros.joints(t, **{name: turn * ticks for name, ticks in zip(WHEELS, m.counts, strict=True)}))
        for t, m in stamped
        if isinstance(m, WheelTicks)
    ]
    rows += [
        ("/scans", t, ros.scan(t, **{r.anchor: r.rssi_dbm for r in m.readings}))
        for t, m in stamped
        if isinstance(m, WifiScan)
    ]
    truth = run.truth
    columns = ((EPOCH_NS + truth.time_ns).tolist(), truth.x.tolist(), truth.y.tolist(), truth.heading.tolist())
    poses = (pose for pose in zip(*columns, strict=True) if pose[0] < EPOCH_NS + 40_000_000_000)
    rows += [("/mocap", pose[0], ros.pose(*pose)) for pose in poses]
    ros.bag(folder / "walk", sorted(rows, key=lambda row: row[1]))
    return folder


@pytest.fixture
def call(place, capsys, monkeypatch):
    """Runs a verb beside the bag; answers code, output, errors."""
    monkeypatch.chdir(place)

    def run(*words):
        code = main([*words])
        return code, *capsys.readouterr()

    return run


LOOK = ("--estimators", "ekf,dead_reckoning", "--worst", "1")
TRUTH = ("--topic", "truth=/mocap")


def test_bag_is_seen_as_the_log_that_is_imported_from_it(call):
    code, seen, err = call("review", "walk", "--world", "world.toml", *TRUTH, *LOOK)
    assert (code, err) == (0, "")
    assert len(seen.splitlines()) == 4
    assert call("import", "rosbag", "walk", "--world", "world.toml", *TRUTH, "-o", "walk.mcap")[0] == 0
    _, imported, _ = call("review", "walk.mcap", *LOOK)
    assert seen.splitlines()[::2] == imported.splitlines()[::2]


def test_bag_is_drawn(call, place):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    assert call("review", "walk", "--world", "world.toml", *TRUTH, "--estimators", "ekf", "--save", "walk.rrd")[0] == 0
    assert (place / "walk.rrd").stat().st_size > 10_000


@pytest.mark.parametrize(
    "subject",
    [
        ("walk", "--world", "world.toml", *TRUTH, "--topic", "wheels=/joints", "--truth-to-map", "0.5", "0", "0.1"),
        ("walk", "--suite", "suite.toml"),
        ("mec", "--suite", "suite.toml"),
    ],
)
def test_command_of_a_worst_moment_opens_the_same_run(call, subject):
    _, seen, _ = call("review", *subject, *LOOK)
    assert len(seen.splitlines()) == 4
    for moment, command in zip(seen.splitlines()[::2], seen.splitlines()[1::2], strict=True):
        _, verb, *words = shlex.split(command)
        code, again, _ = call(verb, *words, "--worst", "1")
        assert code == 0
        assert moment in again.splitlines()


def test_run_of_a_suite_is_the_one_its_bench_scores(call):
    _, of_suite, _ = call("review", "walk", "--suite", "suite.toml", *LOOK)
    assert len(of_suite.splitlines()) == 4
    _, of_bag, _ = call("review", "walk", "--world", "world.toml", *TRUTH, *LOOK)
    assert of_suite.splitlines()[::2] == of_bag.splitlines()[::2]


def test_folder_of_a_bag_is_read_anew_once_its_files_change(place, tmp_path):
    shutil.copytree(place / "walk", tmp_path / "walk")
    source, store = RunSource("walk", mcap="walk", world=str(place / "world.toml")), Store(tmp_path / "store")
    before = content_of(source, tmp_path, store)
    assert content_of(source, tmp_path, store) == before
    (file,) = (tmp_path / "walk").glob("*.mcap")
    shutil.copy(file, file.with_name("more.mcap"))
    assert content_of(source, tmp_path, store) != before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["walk"], "walk: is no log of ours; for a ROS 2 bag give --world WORLD.toml, and --topic"),
        (["walk/walk.mcap"], "walk.mcap: is no log of ours; for a ROS 2 bag give --world WORLD.toml"),
        (["walk", *TRUTH], "give --world WORLD.toml"),
        (["walk", "--world", "none.toml"], "none.toml: cannot be read"),
        (["none", "--world", "world.toml"], "none: cannot be opened"),
        (["none.mcap"], "none.mcap: no such file"),
        (["world.toml"], "world.toml: is no MCAP file"),
        (["walk", "--world", "world.toml", "--topic", "truth=/mocpa"], "did you mean '/mocap'?"),
        (["walk", "--world", "world.toml", "--topic", "truht=/mocap"], "did you mean 'truth'?"),
        (
            ["walk", "--world", "world.toml", "--topic", "truth=/scans"],
            "/scans is of the type fusion_msgs/msg/WifiScan",
        ),
        (["walk", "--world", "world.toml", *LOOK], "--worst: walk holds no ground truth"),
        (["wlak", "--suite", "suite.toml"], "the suite has no run 'wlak'; did you mean 'walk'?"),
        (["walk", "--suite", "suite.toml", *TRUTH], "--suite determines how its bags are read"),
        (["walk", "--world", "world.toml", *LOOK, *TRUTH, "--set", "ekf.gates=1"], "ekf has no parameter 'gates'"),
    ],
)
def test_what_cannot_be_opened_is_refused_with_what_it_needs(call, words, message):
    code, out, err = call("review", *words, "--save", "never.rrd")
    assert (code, out) == (1, "")
    assert message in err


def test_what_a_bag_lacks_is_reported_beside_the_review(call):
    pytest.importorskip("rerun", reason="needs the extra `review`")
    words = ("--topic", "wifi=none", "--estimators", "dead_reckoning", "--save", "blind.rrd")
    code, _, err = call("review", "walk", "--world", "world.toml", *words)
    assert code == 0
    assert "no truth is named, so errors cannot be scored; it may be in /mocap" in err
    assert "holds no ground truth, so nothing shows how far anyone erred" in err
    assert "holds no signal strengths and no ranges, so nothing corrects the odometry" in err


def test_own_log_with_everything_has_no_remarks(call, place):
    simulate("paper_mec", place / "own.mcap", seed=1, duration_s=20.0)
    assert call("review", "own.mcap", *LOOK)[2] == ""
