"""The pose now: the same fold as a replay to the bit, ages that cannot lie, and failures that cost only themselves."""

import json
import math
import threading
from collections import Counter
from contextlib import closing

import pytest

import fusion
from benchmarks.cli.replay import replay
from fusion import (
    Decision,
    Estimate,
    Level,
    LogError,
    NotFoundError,
    ParameterError,
    PluginError,
    Pose,
    Tracker,
    WifiScan,
)
from logs.cli.join import join
from logs.reader import read_run
from sensors.cli.live import record
from sensors.onboard import rolling_log
from sensors.onboard.driver_lifecycle import State
from sensors.onboard.live import live
from tests.sensors.failing_estimator import Breaks


class NeverStarts(Breaks):
    """Fails before anything is measured."""

    def start(self, prior, seed):
        raise ValueError("no idea")


class SaysNonsense(Breaks):
    """Its x is a word."""

    def step(self, state, motion, scan):
        return state, ()

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, Pose("here", 0.0, 0.0), None)


class HasNoMessage(Breaks):
    """Its heading is a number that no quaternion holds."""

    def step(self, state, motion, scan):
        return state._replace(heading=math.inf) if isinstance(scan, WifiScan) else state, ()


@pytest.fixture(autouse=True)
def _estimators():
    with (
        fusion.registered("breaks", Breaks),
        fusion.registered("never_starts", NeverStarts),
        fusion.registered("says_nonsense", SaysNonsense),
        fusion.registered("has_no_message", HasNoMessage),
    ):
        yield


def lived(robot, estimator, duration_s, **options):
    """Every pose, and how it ended."""
    poses, told = live(robot, estimator, duration_s=duration_s, **options), []
    while True:
        try:
            told.append(next(poses))
        except StopIteration as end:
            return told, end.value


DAMAGE = {
    "none": {},
    "a late radio and wheels that go away": {
        "wifi": '{ kind = "clock_jump", amount = -0.3 }',
        "encoders": '{ kind = "unplug", from_s = 0.8, to_s = 1.2 }',
    },
    "a radio whose stamps stand still, a gyro ahead of time": {
        "wifi": '{ kind = "clock_jump", amount = -4.0 }',
        "gyro": '{ kind = "clock_jump", from_s = 1.0, amount = 0.4 }',
    },
}


@pytest.mark.parametrize("faults", DAMAGE.values(), ids=DAMAGE)
def test_a_replay_of_the_log_says_what_was_said_live_to_the_bit(robot, tmp_path, faults):
    options = {"estimate_odometry": False}
    told, ended = lived(
        robot(faults=faults), "ekf", 2.5, folder=tmp_path / "out", shadows=["particle"], options=options, seed=3
    )
    assert ended.trouble == ""
    (log,) = ended.paths
    assert ended.digests == {
        "ekf": replay(log, "ekf", verify=log, options=options, seed=3),
        "particle": replay(log, "particle", verify=log, seed=3),
    }
    run = read_run(log)
    assert json.loads(run.metadata["live_lanes"])["ekf"] == {"parameters": options, "seed": 3}
    assert len(run.lanes["ekf"]) >= len(run.measurements) > 100
    assert [diagnostic for diagnostic in run.diagnostics if diagnostic.text == "status"]
    assert len(told) >= 10
    assert told[-1].measurements >= 100


@pytest.mark.parametrize("faults", DAMAGE.values(), ids=DAMAGE)
def test_every_pose_told_comes_out_of_the_log_again(robot, tmp_path, faults):
    """The first so many measurements of the log folded, and asked for the same time."""
    told, ended = lived(robot(faults=faults), "ekf", 2.0, folder=tmp_path / "out")
    run = read_run(ended.paths[0])
    tracker, folded = Tracker(fusion.build("ekf", run.world), run.world, run.prior), 0
    for now in told:
        for measurement in run.measurements[folded : now.measurements]:
            tracker.push(measurement)
        folded = now.measurements
        assert tracker.estimate(now.time_ns) == now.estimate
    assert folded > 100


def test_the_certificate_in_the_log_tells_other_parameters_and_other_seeds_apart(robot, tmp_path):
    _, ended = lived(robot(), "ekf", 1.3, folder=tmp_path / "out", shadows=["particle"], seed=3)
    (log,) = ended.paths
    for name, options, seed in (("ekf", {"gate_probability": 0.5}, 3), ("particle", None, 4)):
        with pytest.raises(LogError, match="compare seed, parameters"):
            replay(log, name, verify=log, options=options, seed=seed)
    with pytest.raises(LogError, match="no digest of dead_reckoning"):
        replay(log, "dead_reckoning", verify=log)


def test_the_parts_of_a_long_run_are_certified_as_one(robot, tmp_path):
    _, ended = lived(robot(record="min_free_mb = 0.0\nsplit_s = 1.0"), "ekf", 2.3, folder=tmp_path / "out")
    assert len(ended.paths) >= 2
    join([tmp_path / "out"], tmp_path / "whole.mcap")
    whole = tmp_path / "whole.mcap"
    assert replay(whole, "ekf", verify=whole) == ended.digests["ekf"]


def test_fates_are_counted_once_and_lates_are_told(robot, tmp_path):
    """A scan that comes 0.3 s late has everything after it folded again, which says nothing new of those readings."""
    faults = {"wifi": '{ kind = "clock_jump", amount = -0.3 }', "gyro": '{ kind = "clock_jump", amount = -9.0 }'}
    told, ended = lived(robot(faults=faults), "ekf", 2.6, folder=tmp_path / "out")
    run = read_run(ended.paths[0])
    updates = list(fusion.track(fusion.build("ekf", run.world), run.world, run.measurements, run.prior))
    expected = Counter(fate.decision for update in updates if not update.revised for fate in update.fates)
    assert any(update.revised for update in updates)
    assert sum((Counter(now.fates) for now in told), Counter()) <= expected
    assert sum((now.fates for now in told), Counter())[Decision.LATE] > 50
    assert sum((now.fates for now in told), Counter())[Decision.USED] >= 3


def test_a_sensor_that_went_away_is_never_shown_as_fresh(robot):
    faults = {"wifi": '{ kind = "unplug", from_s = 1.2 }'}
    told, _ = lived(robot(faults=faults), "ekf", 2.5, hz=20.0)
    last = told[-1]
    wifi, gyro = last.statuses[-1], last.statuses[1]
    assert wifi.age_s > 0.9
    assert gyro.age_s < wifi.age_s
    gone = [row["age_s"]["wifi"] for row in map(record, told) if row["state"]["wifi"] == "backoff"]
    assert len(gone) > 3
    assert gone == sorted(gone)


def test_old_stamps_are_old_though_they_come_now(robot):
    """The gyro stamps all it says with the time of the start."""
    told, _ = lived(robot(faults={"gyro": '{ kind = "clock_jump", amount = -5.0 }'}), "ekf", 1.0)
    running = [now for now in told[1:] if now.statuses[1].state is State.RUNNING]
    assert len(running) > 3
    for now in running:
        assert now.statuses[1].age_s >= (now.time_ns - told[0].time_ns) / 1e9


@pytest.mark.parametrize("name", ["breaks", "never_starts", "says_nonsense", "has_no_message"])
def test_an_estimator_that_fails_ends_its_own_lane_and_is_told_once(robot, tmp_path, name):
    told, ended = lived(robot(), name, 1.6, folder=tmp_path / "out", shadows=["ekf"])
    assert told[-1].estimate is None
    assert told[-1].error
    assert len([trouble for now in told for trouble in now.news]) == 1
    assert ended.trouble == told[-1].error
    assert set(ended.digests) == {"ekf"}
    log = ended.paths[0]
    run = read_run(log)
    assert [
        (diagnostic.sensor, diagnostic.level) for diagnostic in run.diagnostics if diagnostic.text == ended.trouble
    ] == [(name, Level.ERROR)]
    assert run.measurements[-1].time_ns - run.prior.time_ns > 1.4e9
    assert replay(log, "ekf", verify=log) == ended.digests["ekf"]
    assert record(told[-1])["valid"] is False
    assert json.loads(json.dumps(record(told[-1]), allow_nan=False))["error"] == ended.trouble


def test_a_shadow_that_fails_leaves_the_pose_alone(robot, tmp_path):
    told, ended = lived(robot(), "ekf", 1.2, folder=tmp_path / "out", shadows=["breaks"])
    assert all(now.estimate is not None for now in told)
    assert "breaks failed" in ended.trouble or "Breaks failed" in ended.trouble
    assert replay(ended.paths[0], "ekf") == ended.digests["ekf"]


def test_with_nothing_left_to_say_it_ends(robot):
    told, ended = lived(robot(), "breaks", 60.0)
    assert "no such weight" in ended.trouble
    assert ended.duration_s < 30.0
    assert told


def test_a_disk_that_fills_up_ends_the_recording_and_not_the_pose(robot, tmp_path, monkeypatch):
    full = threading.Event()
    monkeypatch.setattr(rolling_log, "free_bytes", lambda _: 1e6 if full.is_set() else 1e12)
    monkeypatch.setattr("sensors.onboard.recorder.DISK_S", 0.3)
    full_robot = robot(record="min_free_mb = 100.0")
    told = []
    with closing(live(full_robot, "ekf", folder=tmp_path / "out", duration_s=2.0)) as poses:
        for now in poses:
            told.append(now)
            full.set()
    (trouble,) = [trouble for now in told for trouble in now.news]
    assert "the recording ended: the disk is nearly full" in trouble
    run = read_run(next((tmp_path / "out").glob("*.mcap")))
    assert not run.warnings
    assert "live_digests" not in run.metadata
    assert told[-1].estimate is not None
    assert told[-1].time_ns - run.measurements[-1].time_ns > 0.5e9


def test_who_stops_listening_leaves_a_whole_log(robot, tmp_path):
    with closing(live(robot(), "ekf", folder=tmp_path / "out")) as poses:
        for now in poses:
            if now.measurements > 40:
                break
    (log,) = (tmp_path / "out").glob("*.mcap")
    assert not read_run(log).warnings
    assert replay(log, "ekf", verify=log)


def test_what_cannot_be_is_refused_before_anything_runs(robot, tmp_path):
    one, folder = robot(), tmp_path / "out"
    with pytest.raises(PluginError, match="did you mean 'ekf'"):
        live(one, "ekff")
    with pytest.raises(ParameterError, match="did you mean 'gate_probability'"):
        live(one, "ekf", options={"gate_probabillity": 0.9})
    with pytest.raises(PluginError, match="did you mean 'particle'"):
        live(one, "ekf", shadows=["partikle"], folder=folder)
    with pytest.raises(ParameterError, match="its estimates go into a log alone"):
        live(one, "ekf", shadows=["particle"])
    with pytest.raises(ParameterError, match="runs already"):
        live(one, "ekf", shadows=["ekf"], folder=folder)
    for hz in (0.0, -1.0, math.nan, 1e6):
        with pytest.raises(ParameterError, match="hz"):
            live(one, "ekf", hz=hz)
    for duration_s in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ParameterError, match="duration"):
            live(one, "ekf", duration_s=duration_s)
    assert not folder.exists()


def test_a_required_sensor_that_is_missing_refuses_to_start_unless_told(robot):
    gone = robot(faults={"wifi": '{ kind = "unplug" }'})
    with pytest.raises(NotFoundError, match=r"wifi: .*unplugged.*--degraded"):
        next(live(gone, "ekf", patience_s=0.3))
    told, ended = lived(gone, "ekf", 0.5, degraded=True)
    assert told[-1].estimate.valid
    assert record(told[-1])["age_s"]["wifi"] is None
    assert ended.trouble == ""
