"""What is sound in a broken MCAP file is kept, what is lost is told, and other people's readers open the result."""

import contextlib
import json
import os
import random
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from fusion import Gyro, LogError, World
from fusion.cli.main import main
from logs.cli.repair import mend, repair
from logs.reader import read_run
from logs.salvage.records import HEAD, MAGIC
from logs.salvage.scan import Salvage
from logs.writer import RunWriter

SECOND = 1_000_000_000
HOUR = 3600 * SECOND
WORLD = World.from_table({"name": "here", "bounds": {"x_min": 0, "x_max": 1, "y_min": 0, "y_max": 1}})
CODECS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]
PLACEHOLDER = b"\x06" + b"\xff" * 8 + bytes(40)
"""The head of a chunk that a streaming writer was about to fill: its length is not known yet."""


def payload(number):
    """A std_msgs/String that holds the number, as CDR."""
    text = b"%06d\x00" % number
    return b"\x00\x01\x00\x00" + len(text).to_bytes(4, "little") + text


def write_mcap(path, *, chunks=5, per_chunk=4, finished=True, library="somebody", **options):
    """A file of the library's own writer: ``per_chunk`` messages a second on two topics, a chunk each second."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2", library=library)
        writer.add_metadata("site", {"robot": "r2"})
        writer.add_attachment(1, 2, "calibration", "text/plain", b"scale 1.02")
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channels = [writer.register_channel(topic, "cdr", text) for topic in ("/a", "/b")]
        for number in range(chunks * per_chunk):
            time_ns = HOUR + number * SECOND // per_chunk
            writer.add_message(channels[number % 2], time_ns, payload(number), time_ns - 7, number)
            if number % per_chunk == per_chunk - 1:
                writer.flush()
        if finished:
            writer.finish()
    return path


def mended(broken):
    """A repair in memory: what was wrong, how many messages it kept, and the sequence numbers in the result."""
    good, salvage = BytesIO(), Salvage(BytesIO(broken))
    mend(salvage, good)
    return salvage.damage, salvage.messages, read_both_ways(good)


def read_both_ways(good):
    """Sequence numbers as the library finds them by the index, and without it from the first byte to the last."""
    good.seek(0)
    reader = make_reader(good, validate_crcs=True)
    messages = [message for _, _, message in reader.iter_messages()]
    assert all(message.data == payload(message.sequence) for message in messages)
    assert reader.get_summary().statistics.message_count == len(messages)
    good.seek(0)
    assert [message for _, _, message in NonSeekingReader(good, validate_crcs=True).iter_messages()] == messages
    return [message.sequence for message in messages]


def seen(path):
    """Sequence numbers in a file."""
    with path.open("rb") as stream:
        return read_both_ways(stream)


def indexed(path):
    """The index of a whole file."""
    with path.open("rb") as stream:
        return make_reader(stream).get_summary()


def chunk_ends(path):
    """Where the chunks of an unfinished file end."""
    ends = []
    with path.open("rb") as stream, contextlib.suppress(EndOfFile):
        for record in StreamReader(stream, emit_chunks=True).records:
            ends += [stream.tell()] if isinstance(record, Chunk) else []
    return ends


def flipped(whole, bit):
    bad = bytearray(whole)
    bad[bit // 8] ^= 1 << bit % 8
    return bytes(bad)


@pytest.mark.parametrize("codec", CODECS)
def test_whole_file_comes_out_as_it_went_in_to_the_byte(tmp_path, codec):
    path = write_mcap(tmp_path / "run.mcap", compression=codec)
    repaired = repair(path, tmp_path / "good.mcap")
    assert (tmp_path / "good.mcap").read_bytes() == path.read_bytes()
    assert (repaired.messages, repaired.damage.is_lossy, str(repaired.damage)) == (20, False, "")
    assert main(["repair", str(path), "-o", str(tmp_path / "again.mcap")]) == 0


def test_cut_at_any_byte_keeps_every_whole_chunk(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", chunks=3, compression=CompressionType.NONE)
    whole = path.read_bytes()
    chunks = indexed(path).chunk_indexes
    ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in chunks]
    data_end = ends[-1] + chunks[-1].message_index_length
    for size in range(len(MAGIC), len(whole)):
        damage, messages, kept = mended(whole[:size])
        assert kept == list(range(4 * sum(end <= size for end in ends)))
        assert messages == len(kept)
        assert damage.is_lossy == (size < data_end + HEAD + 4)
        assert damage.bytes_dropped <= size
        assert str(damage)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize(
    "tail", [bytes(1), bytes(5000), PLACEHOLDER, PLACEHOLDER + bytes(900), b"\x07\x01", b"\xff" * 99]
)
def test_tail_of_zeros_or_an_unfinished_chunk_is_dropped(tmp_path, codec, tail):
    path = write_mcap(tmp_path / "run.mcap", finished=False, compression=codec)
    path.write_bytes(path.read_bytes() + tail)
    repaired = repair(path, tmp_path / "good.mcap")
    assert seen(tmp_path / "good.mcap") == list(range(20))
    assert (repaired.damage.bytes_dropped, repaired.damage.is_lossy) == (len(tail), True)


@pytest.mark.parametrize("finished", [True, False])
@pytest.mark.parametrize("codec", CODECS)
def test_flipped_bit_never_changes_a_message_and_never_loses_one_unnoticed(tmp_path, codec, finished):
    path = write_mcap(tmp_path / "run.mcap", finished=finished, compression=codec)
    whole = path.read_bytes()

    @settings(derandomize=True, max_examples=300)
    @given(st.integers(8 * len(MAGIC), 8 * len(whole) - 1))
    def check(bit):
        damage, _, kept = mended(flipped(whole, bit))
        assert kept == sorted(set(kept))
        assert len(kept) == 20 or damage.is_lossy

    check()


@pytest.mark.parametrize("codec", CODECS)
def test_damaged_chunk_costs_that_chunk_only_and_its_seconds(tmp_path, codec):
    path = write_mcap(tmp_path / "run.mcap", finished=False, compression=codec)
    whole = path.read_bytes()
    path.write_bytes(flipped(whole, 8 * (chunk_ends(path)[2] - 9)))
    repaired = repair(path, tmp_path / "good.mcap")
    assert seen(tmp_path / "good.mcap") == [*range(8), *range(12, 20)]
    hole, tail = repaired.damage.holes
    assert (hole.from_ns, hole.until_ns) == (HOUR + 7 * SECOND // 4, HOUR + 3 * SECOND)
    assert tail.start == tail.end == len(whole)
    assert "at most 1.2 s lost between 1.8 s and 3.0 s" in str(repaired.damage)


def test_chunk_whose_length_is_damaged_is_passed_by_the_index(tmp_path):
    path = write_mcap(tmp_path / "run.mcap")
    start = indexed(path).chunk_indexes[1].chunk_start_offset
    path.write_bytes(flipped(path.read_bytes(), 8 * (start + 1)))
    repaired = repair(path, tmp_path / "good.mcap")
    assert seen(tmp_path / "good.mcap") == [*range(4), *range(8, 20)]
    assert repaired.damage.missing == 4


def test_last_chunk_damaged_ends_where_the_index_says(tmp_path):
    path = write_mcap(tmp_path / "run.mcap")
    start = indexed(path).chunk_indexes[-1].chunk_start_offset
    path.write_bytes(flipped(path.read_bytes(), 8 * (start + 60)))
    repaired = repair(path, tmp_path / "good.mcap")
    assert repaired.damage.seconds_lost == 1.0  # from 3.75 s, the last stamp kept, to 4.75 s, the last one written
    assert repaired.damage.finished


def test_channels_lost_with_the_first_chunk_come_from_the_index(tmp_path):
    path = write_mcap(tmp_path / "run.mcap")
    start = indexed(path).chunk_indexes[0].chunk_start_offset
    path.write_bytes(flipped(path.read_bytes(), 8 * (start + 60)))
    repaired = repair(path, tmp_path / "good.mcap")
    assert seen(tmp_path / "good.mcap") == list(range(4, 20))
    assert repaired.damage.seconds_lost is None  # nothing says when the first one began
    assert {channel.topic for channel in indexed(tmp_path / "good.mcap").channels.values()} == {"/a", "/b"}


def test_messages_whose_channel_nobody_declares_are_no_use(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", finished=False, compression=CompressionType.NONE)
    whole = path.read_bytes()
    path.write_bytes(flipped(whole, 8 * whole.index(b"string data")))
    repaired = repair(path, tmp_path / "good.mcap")
    assert (repaired.messages, len(repaired.damage.holes)) == (0, 6)
    assert seen(tmp_path / "good.mcap") == []


def test_chunks_without_an_index_get_one(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", index_types=IndexType.NONE, use_statistics=False)
    assert indexed(path).chunk_indexes == []
    repaired = repair(path, tmp_path / "good.mcap")
    summary = indexed(tmp_path / "good.mcap")
    assert not repaired.damage.is_lossy
    assert (len(summary.chunk_indexes), len(summary.attachment_indexes), len(summary.metadata_indexes)) == (5, 1, 1)
    assert all(index.message_index_offsets.keys() == {1, 2} for index in summary.chunk_indexes)
    assert seen(tmp_path / "good.mcap") == list(range(20))


def test_messages_outside_of_chunks_are_kept_one_by_one(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", use_chunking=False, finished=False)
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    repaired = repair(path, tmp_path / "good.mcap")
    assert seen(tmp_path / "good.mcap") == list(range(19))
    assert (repaired.messages, repaired.damage.bytes_dropped) == (19, len(whole) - 1 - whole.rindex(payload(19)) + 31)


def test_damage_outside_of_chunks_shows_in_the_checksum_of_the_whole(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", use_chunking=False, enable_data_crcs=True)
    assert not repair(path, tmp_path / "good.mcap").damage.is_lossy
    path.write_bytes(path.read_bytes().replace(payload(3), payload(4)))
    repaired = repair(path, tmp_path / "other.mcap")
    assert (repaired.messages, repaired.damage.is_lossy) == (20, True)
    assert "checksum of the whole differs" in json.dumps(repaired.record())


def test_attachment_and_metadata_come_through_and_a_damaged_attachment_does_not(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", finished=False)
    repair(path, tmp_path / "good.mcap")
    with (tmp_path / "good.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert [attachment.data for attachment in reader.iter_attachments()] == [b"scale 1.02"]
        about, told = reader.iter_metadata()
        assert (about.name, about.metadata) == ("site", {"robot": "r2"})
        assert told.name == "fusion repair"
    path.write_bytes(path.read_bytes().replace(b"scale 1.02", b"scale 1.03"))
    repair(path, tmp_path / "other.mcap")
    assert indexed(tmp_path / "other.mcap").attachment_indexes == []
    assert seen(tmp_path / "other.mcap") == list(range(20))


def test_writer_that_does_not_flush_has_lost_nobody_knows_how_much(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", finished=False)
    assert repair(path, tmp_path / "good.mcap").damage.seconds_lost is None
    assert "an unknown time lost after 4.8 s" in str(repair(path, tmp_path / "other.mcap").damage)
    path.write_bytes(path.read_bytes()[:-200])
    assert "at least 1.0 s" in str(repair(path, tmp_path / "third.mcap").damage)


def test_repaired_file_is_whole_and_remembers_what_it_lost(tmp_path):
    path = own_log(tmp_path / "run.mcap", 1000)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    first = repair(path, tmp_path / "good.mcap")
    second = repair(tmp_path / "good.mcap", tmp_path / "again.mcap")
    assert not second.damage.is_lossy
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "good.mcap").read_bytes()
    (warning,) = read_run(tmp_path / "good.mcap").warnings
    assert str(first.damage) in warning


def own_log(path, count):
    with RunWriter(path, WORLD, name="test") as log:
        for number in range(count):
            log.write(Gyro(number * SECOND // 100, "g", number, random.Random(number).random()))
    return path


def test_reading_in_place_and_reading_the_repaired_file_are_the_same_in_the_same_words(tmp_path):
    path = own_log(tmp_path / "run.mcap", 1000)
    whole = path.read_bytes()
    start = indexed(path).chunk_indexes[4].chunk_start_offset
    holed = whole[: start + 90] + bytes(8) + whole[start + 98 :]
    for bad in (whole[:-1], whole[: len(whole) // 2], holed, holed[:-20], whole[:7000] + bytes(99)):
        path.write_bytes(bad)
        repaired = repair(path, tmp_path / "good.mcap", force=True)
        in_place = read_run(path)
        assert in_place.measurements == read_run(tmp_path / "good.mcap").measurements
        assert len(in_place.measurements) == repaired.messages
        assert str(repaired.damage) in in_place.warnings[0]
        assert f"fusion repair {path}" in in_place.warnings[0]


RECORDER = """
import os, random, sys
from pathlib import Path
from fusion import Gyro, World
from logs.writer import RunWriter
world = World.from_table({"name": "here", "bounds": {"x_min": 0, "x_max": 1, "y_min": 0, "y_max": 1}})
log = RunWriter(Path(sys.argv[1]), world, name="killed")
noise = random.Random(0)
for number in range(10**9):
    log.write(Gyro(number * 10_000_000, "g", number, noise.random()))
    os.write(1, b"%d\\n" % number)
"""


@pytest.mark.parametrize("moment", [1, 99, 731, 4242, 9999])
def test_killed_recorder_loses_no_more_than_is_told(tmp_path, moment):
    path, good = tmp_path / "run.mcap", tmp_path / "good.mcap"
    with subprocess.Popen([sys.executable, "-c", RECORDER, str(path)], stdout=subprocess.PIPE) as recorder:
        for _ in range(moment):
            recorder.stdout.readline()
        recorder.kill()
        told = recorder.stdout.read().splitlines()
    written = int(told[-1]) if told else moment - 1
    repaired = repair(path, good)
    kept = read_run(good).measurements
    assert [measurement.seq for measurement in kept] == list(range(len(kept)))
    assert len(kept) == repaired.messages
    assert (written - kept[-1].seq) / 100 <= repaired.damage.seconds_lost == 1.0
    assert "at most 1.0 s lost" in str(repaired.damage)


def test_rosbags_and_rerun_open_what_was_repaired(tmp_path):
    from rosbags.highlevel import AnyReader

    path, good = write_mcap(tmp_path / "run.mcap"), tmp_path / "good.mcap"
    path.write_bytes(flipped(path.read_bytes(), 8 * (indexed(path).chunk_indexes[2].chunk_start_offset + 60))[:-50])
    repair(path, good)
    with AnyReader([good]) as reader:
        texts = [reader.deserialize(data, to.msgtype).data for to, _, data in reader.messages()]
    assert texts == [f"{number:06d}" for number in (*range(8), *range(12, 20))]
    rerun = Path(sys.executable).with_name("rerun")
    checked = subprocess.run([rerun, "mcap", "check", "--full", good], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
    assert subprocess.run([rerun, "mcap", "check", path], capture_output=True, check=False).returncode != 0


def test_command_tells_what_was_kept_and_lost_in_words_and_as_json(tmp_path, capsys):
    path, good = own_log(tmp_path / "run.mcap", 1000), tmp_path / "good.mcap"
    path.write_bytes(path.read_bytes()[:20000])
    assert main(["repair", str(path), "-o", str(good)]) == 3
    text = capsys.readouterr().out
    assert main(["repair", str(path), "-o", str(good), "--force", "--json"]) == 3
    about = json.loads(capsys.readouterr().out)
    assert f"{about['messages_kept']} messages kept" in text
    assert about["damage"] in text
    assert (about["lossy"], about["seconds_lost_at_most"]) == (True, 1.0)
    assert about["messages_kept"] == len(read_run(good).measurements)


def test_pipe_is_refused(tmp_path):
    command = [sys.executable, "-m", "fusion.cli.main", "info", "/dev/stdin"]
    content = write_mcap(tmp_path / "run.mcap").read_bytes()
    done = subprocess.run(command, input=content, capture_output=True, check=False)
    assert (done.returncode, done.stderr.count(b"\n")) == (1, 1)
    assert b"give a file" in done.stderr


@pytest.mark.parametrize("content", [b"", MAGIC[:7], b"hello, this is no MCAP"])
def test_what_is_no_mcap_file_is_refused(tmp_path, content, capsys):
    (tmp_path / "run.mcap").write_bytes(content)
    assert main(["repair", str(tmp_path / "run.mcap"), "-o", str(tmp_path / "good.mcap")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert os.listdir(tmp_path) == ["run.mcap"]


def test_broken_file_is_never_written_to_and_another_only_if_asked(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", finished=False)
    before = path.read_bytes()
    (tmp_path / "link.mcap").symlink_to(path)
    for good in (path, tmp_path / "link.mcap"):
        with pytest.raises(LogError, match="never touched"):
            repair(path, good, force=True)
    other = tmp_path / "other.mcap"
    other.write_text("mine")
    with pytest.raises(LogError, match="exists already"):
        repair(path, other)
    assert (path.read_bytes(), other.read_text()) == (before, "mine")
    with pytest.raises(LogError, match="exists already"):
        repair(path, tmp_path, force=True)
    for nowhere in (tmp_path / "nowhere" / "good.mcap", path / "good.mcap"):
        with pytest.raises(LogError, match="choose another place"):
            repair(path, nowhere)
    assert main(["repair", str(path), "-o", str(other), "--force"]) == 3
    assert seen(other) == list(range(20))


def test_without_an_output_the_usage_is_wrong(tmp_path):
    with pytest.raises(SystemExit) as stopped:
        main(["repair", str(tmp_path / "run.mcap")])
    assert stopped.value.code == 2


FULL = """
import resource, signal, sys
from fusion.cli.main import main
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (700, 700))
sys.exit(main(["repair", sys.argv[1], "-o", sys.argv[2], "--force"]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit on the size of files")
def test_disk_that_fills_leaves_no_half_written_file(tmp_path):
    path, good = write_mcap(tmp_path / "run.mcap", finished=False), tmp_path / "good.mcap"
    good.write_text("what was there before")
    done = subprocess.run([sys.executable, "-c", FULL, path, good], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "free some space" in done.stderr
    assert good.read_text() == "what was there before"
    assert sorted(os.listdir(tmp_path)) == ["good.mcap", "run.mcap"]
