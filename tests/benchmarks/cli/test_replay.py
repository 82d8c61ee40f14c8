"""A replay gives the same twice, and proves it."""

import pytest

import fusion
from benchmarks.cli.replay import replay
from benchmarks.runner.adhoc_suite import bench
from fusion import (
    Covariance,
    Estimate,
    LogError,
    Odometry,
    ParameterError,
    PluginError,
    Pose,
    RangeReading,
    Ranges,
    Truth,
)
from logs.reader import read_run
from logs.writer import RunWriter

TENTH_NS = 100_000_000
ANCHORS = [{"id": name, "position_m": place} for name, place in (("a", (0, 0)), ("b", (8, 0)), ("c", (4, 3)))]
WORLD = fusion.World.from_table({"name": "corridor", "anchors": ANCHORS})


class Counts:
    """Its x is the number of epochs that it was given."""

    summary = "counts epochs"
    tags = frozenset()

    def __init__(self, world, scale: float = 1.0):
        self.scale = scale

    def start(self, prior, seed):
        return seed

    def step(self, state, motion, scan):
        return state + 1, ()

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, Pose(self.scale * state, 0.0, 0.0), Covariance.from_std(1.0, 1.0, 1.0))


@pytest.fixture(autouse=True)
def _estimator():
    with fusion.registered("toy_counts", Counts):
        yield


@pytest.fixture
def log(tmp_path):
    """Ten increments, three ranges, and one more that comes half a second late."""
    path = tmp_path / "run.mcap"
    with RunWriter(path, WORLD, name="run", metadata={"robot": "number five"}) as writer:
        for k in range(1, 11):
            writer.write_truth(Truth(k * TENTH_NS, 0.1 * k, 0.0, None))
            writer.write(Odometry(k * TENTH_NS, "wheels", k, (k - 1) * TENTH_NS, 0.1, 0.0))
            if k % 3 == 0:
                writer.write(Ranges(k * TENTH_NS, "uwb", k, (RangeReading("a", 1.0),)))
            if k == 8:
                late = Ranges(3 * TENTH_NS + 5, "uwb", 100, (RangeReading("b", 2.0),))
                writer.write(late, log_time_ns=8 * TENTH_NS)
    return path


def test_two_replays_give_identical_bytes(log, tmp_path):
    outputs = [tmp_path / name / "out.mcap" for name in "ab"]
    for output in outputs:
        output.parent.mkdir()
    digests = {replay(log, "toy_counts", output) for output in outputs}
    assert len(digests) == 1
    assert outputs[0].read_bytes() == outputs[1].read_bytes()


def test_replayed_log_replays_to_the_same_digest_late_message_included(log, tmp_path):
    first = replay(log, "toy_counts", tmp_path / "first.mcap")
    again = replay(tmp_path / "first.mcap", "toy_counts", tmp_path / "again.mcap")
    assert first == again
    assert read_run(tmp_path / "first.mcap").measurements == read_run(log).measurements


def test_replay_keeps_the_metadata_and_adds_the_certificate(log, tmp_path):
    digest = replay(log, "toy_counts", tmp_path / "out.mcap", seed=3, options={"scale": 2.0})
    metadata = read_run(tmp_path / "out.mcap").metadata
    assert metadata["robot"] == "number five"
    assert (metadata["digest"], metadata["estimator"], metadata["seed"]) == (digest, "toy_counts", "3")
    assert metadata["parameters"] == '{"scale": 2.0}'


def test_replay_and_bench_agree_on_the_digest(log):
    (score,) = bench([log], estimators=["toy_counts"], workers=1, seed=2)
    assert score.digest == replay(log, "toy_counts", seed=2)


def test_verification_passes_for_the_same_and_fails_for_another_seed(log, tmp_path):
    earlier = tmp_path / "out.mcap"
    digest = replay(log, "toy_counts", earlier)
    assert replay(log, "toy_counts", verify=earlier) == digest
    with pytest.raises(LogError, match="compare seed, parameters and versions"):
        replay(log, "toy_counts", verify=earlier, seed=1)
    with pytest.raises(LogError, match="holds no digest"):
        replay(log, "toy_counts", verify=log)


def test_replay_refuses_to_write_over_its_own_log(log):
    before = log.read_bytes()
    with pytest.raises(LogError, match="another name"):
        replay(log, "toy_counts", log)
    assert log.read_bytes() == before


def test_unknown_names_are_answered_with_the_nearest(log):
    with pytest.raises(PluginError, match="did you mean 'toy_counts'"):
        replay(log, "toy_count")
    with pytest.raises(ParameterError, match="did you mean 'scale'"):
        replay(log, "toy_counts", options={"scal": 1.0})
