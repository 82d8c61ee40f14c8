"""Salvage of broken MCAP files: what is sound is kept, and the loss is stated."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType

from fusion.cli.main import main
from logs.cli.repair import repair
from logs.salvage.records import HEAD, MAGIC
from tests.logs.salvage.broken_logs import (
    CODECS,
    HOUR,
    PLACEHOLDER,
    SECOND,
    chunk_ends,
    flipped,
    indexed,
    mended,
    payload,
    seen,
    write_mcap,
)


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


def test_last_chunk_damaged_ends_where_the_index_ends_it(tmp_path):
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
    assert repaired.damage.seconds_lost is None  # nothing states when the first one began
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
        about, loss = reader.iter_metadata()
        assert (about.name, about.metadata) == ("site", {"robot": "r2"})
        assert loss.name == "fusion repair"
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
