"""A log keeps what is written to the bit, and a damaged one opens with a warning."""

import json
import math
import struct

import numpy as np
import pytest
from mcap.records import Message

from fusion import (
    Covariance,
    Gyro,
    LogError,
    MotorCommand,
    Odometry,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    Truth,
    WheelTicks,
    WifiScan,
)
from logs.cli.export import export_csv
from logs.cli.import_ import import_recordings
from logs.cli.info import describe
from logs.messages import PRIOR, encode_prior
from logs.reader import read_run
from logs.writer import RunWriter
from tests.worlds import anchored_world

SECOND = 1_000_000_000
WORLD = anchored_world({"ä": (0, 0), "b": (1, 0)}, name="here")
EVERY_KIND = (
    WheelTicks(SECOND, "enc", 1, (1, -2, 3, 4)),
    MotorCommand(SECOND + 1, "cmd", 2, (0.1, -0.2)),
    Odometry(SECOND + 2, "odo", 3, SECOND, 0.1 + 0.2, -1e-17, measured=False),
    Gyro(SECOND + 3, "gyro", 4, 0.123456789012345678),
    WifiScan(SECOND + 4, "wifi", 5, (RssiReading("ä", -51.25, 7), RssiReading("b", float("inf")))),
    Ranges(SECOND + 5, "uwb", 6, (RangeReading("b", 1 / 3), RangeReading("ä", 2.0, 0.1))),
)


def write(path, count=1):
    prior = Prior(SECOND, Pose(1.0, 2.0, 0.5), Covariance.from_std(0.1, 0.2, 0.3), heading_known=False)
    with RunWriter(path, WORLD, name="test", prior=prior, metadata={"note": "x"}) as log:
        for k in range(count):
            for m in EVERY_KIND:
                log.write(type(m)(m.time_ns + k * SECOND, *[getattr(m, f) for f in m.__slots__[1:]]))
        log.write_truth(Truth(SECOND, 3.0, 4.0))
        log.write_truth(Truth(2 * SECOND, 3.5, 4.0, 0.25))
    return path


def test_every_value_comes_back_as_it_was(tmp_path):
    run = read_run(write(tmp_path / "run.mcap"))
    assert run.measurements == EVERY_KIND
    assert run.world == WORLD
    assert run.world.hash == WORLD.hash
    assert run.prior.pose == pytest.approx((1.0, 2.0, 0.5), abs=1e-15)
    assert run.prior.position_known
    assert not run.prior.heading_known
    assert run.truth.x.tolist() == [3.0, 3.5]
    assert str(run.truth.heading[0]) == "nan"
    assert run.metadata["note"] == "x"
    assert run.warnings == ()


def test_truth_keeps_every_unknown_heading_and_counts_unknown_positions(tmp_path):
    truths = [Truth(1, 1.0, 0.0, 0.5), Truth(2, 2.0, 0.0), Truth(3, 3.0, 0.0, math.nan), Truth(4, math.nan, 0.0, 0.5)]
    with RunWriter(tmp_path / "run.mcap", WORLD, name="test") as log:
        for truth in truths:
            log.write_truth(truth)
        log.write(EVERY_KIND[0])
    run = read_run(tmp_path / "run.mcap")
    assert run.truth.x.tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(run.truth.heading).tolist() == [False, True, True]
    assert run.warnings == (f"{tmp_path / 'run.mcap'}: 1 of 4 true poses have no position, and are left out",)


@pytest.mark.parametrize(
    ("written", "spoilt"),
    [(3.0, math.nan), (4.0, math.inf), (0.25, -0.25)],
    ids=["a position that is no number", "one that is infinite", "a variance below zero"],
)
def test_prior_of_an_older_log_that_no_estimator_could_start_from_is_left_out(tmp_path, written, spoilt):
    """Logs used to keep them, and every estimator then answered NaN."""
    sound = Prior(SECOND, Pose(3.0, 4.0, 0.5), Covariance(0.25, 0.0, 0.0, 0.5, 0.0, 0.01))
    data, about = encode_prior(sound)
    data = data.replace(struct.pack("<d", written), struct.pack("<d", spoilt))
    with RunWriter(tmp_path / "old.mcap", WORLD, name="test", metadata=about) as log:
        log.copy(*PRIOR, Message(channel_id=0, log_time=SECOND, data=data, publish_time=SECOND, sequence=0))
        log.write(EVERY_KIND[0])
    run = read_run(tmp_path / "old.mcap")
    assert run.prior is None
    (warning,) = run.warnings
    assert "its starting prior is left out (prior: " in warning


def test_file_cut_anywhere_opens_with_a_warning_or_is_refused_with_the_reason(tmp_path):
    whole = write(tmp_path / "run.mcap", count=30).read_bytes()
    cut = tmp_path / "cut.mcap"
    for share in range(1, 40):
        cut.write_bytes(whole[: len(whole) * share // 40])
        try:
            warnings = read_run(cut).warnings
        except LogError as error:
            warnings = (str(error),)
        assert any("cut.mcap" in warning for warning in warnings)


def test_ros_2_tools_read_the_log(tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with write(tmp_path / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    assert decoded["/wheel/odometry"].distance_m == 0.1 + 0.2
    assert decoded["/imu/raw"].angular_velocity.z == EVERY_KIND[3].rate_rad_s
    assert [r.anchor for r in decoded["/wifi/scan"].readings] == ["ä", "b"]
    assert decoded["/ground_truth"].pose.position.x == 3.5


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n"])
def test_foreign_file_is_refused_in_one_sentence(tmp_path, content):
    path = tmp_path / "odd.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"odd\.mcap"):
        read_run(path)


def test_exported_bundle_imports_as_the_same_run(tmp_path):
    source = write(tmp_path / "run.mcap", count=3)
    export_csv(source, tmp_path / "bundle")
    (again,) = import_recordings("csv", tmp_path / "bundle", tmp_path / "again.mcap")
    before, after = read_run(source), read_run(again)
    kinds = (Gyro, Ranges, WheelTicks)
    plain = [[(type(m), m.time_ns) for m in run.measurements if isinstance(m, kinds)] for run in (before, after)]
    assert plain[0] == plain[1]
    assert after.world.hash == before.world.hash
    assert after.truth.x.tolist() == before.truth.x.tolist()


def test_info_shows_rates_gaps_and_warnings(tmp_path):
    about = describe(write(tmp_path / "run.mcap", count=11))
    gyro = next(row for row in about["channels"] if row["kind"] == "Gyro")
    assert gyro["rate_hz"] == pytest.approx(1.0)
    assert gyro["longest_gap_s"] == 1.0
    assert about["truth"] == 2
    json.dumps(about)
