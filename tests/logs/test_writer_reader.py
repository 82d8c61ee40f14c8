"""A log keeps every bit, survives a crash but for its last second, and states what is wrong with it."""

import math
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from fusion import (
    Covariance,
    Estimate,
    Gyro,
    LogError,
    Odometry,
    PluginError,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    Truth,
    Update,
)
from logs.messages import CODECS
from logs.reader import read_run
from logs.schemas import SCHEMAS
from logs.writer import RUN_RECORD, RunWriter
from tests.worlds import anchored_world

SECOND = 1_000_000_000
WORLD = anchored_world({"a": (0, 0), "b": (1, 0)}, name="here")


def gyro(time_ns, rate=0.5, seq=0):
    return Gyro(time_ns, "gyro", seq, rate)


def written(path, measurements, **options):
    with RunWriter(path, WORLD, name="test", **options) as log:
        for measurement in measurements:
            log.write(measurement)
    return path


def ten_seconds():
    noise = random.Random(1)
    return [gyro(i * SECOND // 20, noise.random(), i) for i in range(200)]


def test_every_finite_heading_of_the_prior_comes_back_to_the_bit(tmp_path):
    @settings(derandomize=True, max_examples=30)
    @given(st.floats(-math.pi, math.pi), st.booleans(), st.booleans())
    def check(heading, position_known, heading_known):
        covariance = Covariance(1.0, 0.1, 0.2, 2.0, 0.3, 3.0)
        prior = Prior(SECOND, Pose(0.1 + 0.2, -1e300, heading), covariance, position_known, heading_known)
        assert read_run(written(tmp_path / "run.mcap", [gyro(SECOND)], prior=prior)).prior == prior

    check()


def test_estimate_comes_back_with_what_it_does_not_claim(tmp_path):
    measurement = Ranges(SECOND, "uwb", 0, (RangeReading("a", 1.0),))
    estimates = (
        Estimate(SECOND, Pose(1.0, 2.0, 0.0), None, heading_known=False),
        Estimate(2 * SECOND, Pose(1.0, 2.0, 0.0), Covariance(1.0, 0.1, 0.2, 2.0, 0.3, 3.0)),
    )
    with RunWriter(tmp_path / "run.mcap", WORLD, name="test") as log:
        log.write(measurement)
        for estimate in estimates:
            log.write_update("ekf", Update(measurement, estimate, ()))
    run = read_run(tmp_path / "run.mcap")
    assert run.lanes == {"ekf": estimates}
    assert run.warnings == ()


@pytest.mark.parametrize(
    "estimate", [Estimate(SECOND, Pose(0.0, 0.0, math.inf), None), Estimate(-1, Pose(0.0, 0.0, 0.0), None)]
)
def test_what_no_message_can_hold_is_the_estimators_fault_and_the_log_goes_on(tmp_path, estimate):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="test") as log:
        with pytest.raises(PluginError, match="odd_one: its update by 'gyro' at 1000000000 ns fits no message"):
            log.write_update("odd_one", Update(gyro(SECOND), estimate, ()))
        log.write(gyro(2 * SECOND))
    run = read_run(tmp_path / "run.mcap")
    assert (run.measurements, dict(run.lanes), run.warnings) == ((gyro(2 * SECOND),), {}, ())


def test_what_is_known_only_at_the_end_is_in_the_metadata(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="test", metadata={"a": "1", "b": "2"}) as log:
        log.write(gyro(SECOND))
        log.note({"b": "3", "c": "4"})
    about = read_run(tmp_path / "run.mcap").metadata
    assert (about["a"], about["b"], about["c"], about["name"]) == ("1", "3", "4", "test")


def test_measurements_come_in_the_order_they_arrived(tmp_path):
    early, late = gyro(SECOND, 1.0), gyro(SECOND // 2, 2.0)
    with RunWriter(tmp_path / "run.mcap", WORLD, name="test") as log:
        log.write(late, log_time_ns=3 * SECOND)
        log.write(early)
    assert read_run(tmp_path / "run.mcap").measurements == (early, late)


def test_same_input_gives_the_same_bytes(tmp_path):
    first, second = (written(tmp_path / name, ten_seconds()).read_bytes() for name in ("a.mcap", "b.mcap"))
    assert first == second


def test_crash_loses_at_most_the_last_second(tmp_path):
    path = tmp_path / "run.mcap"
    log = RunWriter(path, WORLD, name="test")
    for measurement in ten_seconds():
        log.write(measurement)
    (tmp_path / "crashed.mcap").write_bytes(path.read_bytes())
    log.close()
    run = read_run(tmp_path / "crashed.mcap")
    assert run.measurements[-1].time_ns >= ten_seconds()[-1].time_ns - SECOND
    assert run.measurements == tuple(ten_seconds()[: len(run.measurements)])
    assert "cut off" in run.warnings[0]


def test_first_message_is_on_disk_at_once_and_brings_the_world(tmp_path):
    path = tmp_path / "run.mcap"
    with RunWriter(path, WORLD, name="test") as log:
        log.write(gyro(SECOND))
        run = read_run(path)
    assert run.world == WORLD
    assert run.measurements == (gyro(SECOND),)


def test_damaged_byte_never_changes_a_value_unnoticed(tmp_path):
    whole = written(tmp_path / "run.mcap", ten_seconds()).read_bytes()
    damaged, noise = tmp_path / "damaged.mcap", random.Random(2)
    for _ in range(60):
        bad = bytearray(whole)
        bad[noise.randrange(8, len(bad))] ^= 1 << noise.randrange(8)
        damaged.write_bytes(bad)
        try:
            run = read_run(damaged)
        except LogError:
            continue
        written_ones = iter(ten_seconds())
        assert all(measurement in written_ones for measurement in run.measurements)  # none changed, all in order
        assert len(run.measurements) == 200 or run.warnings


def test_zero_filled_tail_is_reported(tmp_path):
    path = written(tmp_path / "run.mcap", ten_seconds())
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + bytes(500))
    (warning,) = read_run(path).warnings
    assert "cannot be read" in warning


@pytest.mark.parametrize("time_ns", [-1, 2**31 * SECOND])
def test_time_that_a_log_cannot_hold_is_refused(tmp_path, time_ns):
    with pytest.raises(LogError, match="shift the run's clock"):
        written(tmp_path / "run.mcap", [gyro(time_ns)])


@pytest.mark.parametrize("seq", [-1, 2**32])
def test_number_that_a_log_cannot_hold_is_refused(tmp_path, seq):
    with pytest.raises(LogError, match="counts from 0"):
        written(tmp_path / "run.mcap", [gyro(SECOND, seq=seq)])


def test_last_time_that_fits_comes_back(tmp_path):
    last = Odometry(2**31 * SECOND - 1, "odo", 2**32 - 1, -5, 0.1, 0.2)
    assert read_run(written(tmp_path / "run.mcap", [last])).measurements == (last,)


def test_log_without_messages_is_refused(tmp_path):
    with pytest.raises(LogError, match="holds no messages"):
        read_run(written(tmp_path / "run.mcap", []))


def test_truth_alone_opens_with_a_warning(tmp_path):
    with RunWriter(tmp_path / "run.mcap", WORLD, name="test") as log:
        log.write_truth(Truth(SECOND, 1.0, 2.0))
    assert "no measurements" in read_run(tmp_path / "run.mcap").warnings[0]


@pytest.mark.parametrize("name", ["missing.mcap", "."])
def test_what_is_no_file_is_refused(tmp_path, name):
    with pytest.raises(LogError, match="cannot be opened"):
        read_run(tmp_path / name)


def test_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(LogError, match="choose another place"):
        RunWriter(tmp_path / "file" / "run.mcap", WORLD, name="test")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_full_disk_is_reported_in_one_sentence():
    with pytest.raises(LogError, match="free some space"):
        written(Path("/dev/full"), ten_seconds())


def foreign(path, record, *more):
    """An MCAP file of somebody else's making: one gyro message on a topic of its own, then ``more`` (topic, bytes)."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        if record:
            writer.add_metadata(RUN_RECORD, record)
        codec = CODECS[Gyro]
        imu = writer.register_schema(codec.schema, "ros2msg", SCHEMAS[codec.schema].encode())
        writer.add_message(writer.register_channel("/turning", "cdr", imu), SECOND, codec.encode(gyro(SECOND)), SECOND)
        other = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        for topic, payload in more:
            schema = imu if topic == codec.topic else other
            writer.add_message(writer.register_channel(topic, "cdr", schema), SECOND, payload, SECOND)
        writer.finish()
    return path


def test_log_without_a_world_is_refused(tmp_path):
    with pytest.raises(LogError, match="holds no world"):
        read_run(foreign(tmp_path / "run.mcap", {}))


def test_log_with_a_world_that_contradicts_itself_is_refused(tmp_path):
    with pytest.raises(LogError, match="did you mean 'anchors'"):
        read_run(foreign(tmp_path / "run.mcap", {"world": '{"anchor": []}'}))


def test_measurement_is_known_by_its_type_and_other_topics_are_reported(tmp_path):
    run = read_run(foreign(tmp_path / "run.mcap", {"world": WORLD.table, "world_hash": "another"}, ("/chatter", b"")))
    assert run.measurements == (gyro(SECOND),)
    assert "hash differs" in run.warnings[0]
    assert "/chatter" in run.warnings[1]


@pytest.mark.parametrize("topic", ["/imu/raw", "/initialpose", "/ground_truth", "/estimate/ekf"])
def test_message_that_cannot_be_decoded_is_counted_and_the_others_are_read(tmp_path, topic):
    run = read_run(foreign(tmp_path / "run.mcap", {"world": WORLD.table}, (topic, b"\x00\x01\x00\x00short")))
    assert (run.measurements, run.prior, run.truth, dict(run.lanes)) == ((gyro(SECOND),), None, None, {})
    assert f"1 messages of {topic} cannot be decoded" in run.warnings[0]


def test_rosbags_reads_every_message(tmp_path):
    from rosbags.highlevel import AnyReader

    path = written(tmp_path / "run.mcap", ten_seconds())
    with AnyReader([path]) as reader:
        rates = [
            reader.deserialize(data, connection.msgtype).angular_velocity.z
            for connection, _, data in reader.messages()
            if connection.topic == "/imu/raw"
        ]
    assert rates == [measurement.rate_rad_s for measurement in ten_seconds()]
