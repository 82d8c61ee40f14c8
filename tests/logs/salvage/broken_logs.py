"""Whole MCAP files of the library's writer and of ours, ways to break them, and two ways to read the result."""

import contextlib
import random
from io import BytesIO

from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from fusion import Gyro
from logs.cli.repair import mend
from logs.salvage.scan import Salvage
from logs.writer import RunWriter
from tests.worlds import empty_world

SECOND = 1_000_000_000
HOUR = 3600 * SECOND
WORLD = empty_world(name="here")
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


def own_log(path, count):
    with RunWriter(path, WORLD, name="test") as log:
        for number in range(count):
            log.write(Gyro(number * SECOND // 100, "g", number, random.Random(number).random()))
    return path
