"""The records of an MCAP file, read strictly: a record whose lengths do not add up is not sound, whatever it parses to.

The `mcap` library reads and writes every record; what it lets pass is refused here, because a single flipped bit can
turn one kind of record into another that still parses.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from io import BytesIO
from typing import NamedTuple

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    Schema,
)
from mcap.stream_reader import get_chunk_data_stream

MAGIC = b"\x89MCAP0\r\n"
HEAD = 1 + 8
"""Bytes of the opcode and the length before every record."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence number, log time and publish time of a message, before its data."""
PARSERS: Mapping[int, Callable[[ReadDataStream], McapRecord]] = {
    Opcode.HEADER: Header.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.MESSAGE_INDEX: MessageIndex.read,
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.METADATA: Metadata.read,
    Opcode.DATA_END: DataEnd.read,
}
"""Records that may stand before the index, but for messages, whose parser wants their length."""


class Piece(NamedTuple):
    """One sound record: its bytes as they stand in the file, and for a chunk the records in it, each with its offset
    in the uncompressed chunk.
    """

    raw: bytes
    record: McapRecord
    inside: list[tuple[int, McapRecord]]

    @property
    def records(self) -> Iterable[McapRecord]:
        """The record, or those in the chunk."""
        return (record for _, record in self.inside) if isinstance(self.record, Chunk) else (self.record,)


class ExactStream(ReadDataStream):
    """A stream that raises `EndOfFile` where the library's would answer with fewer bytes than were asked for."""

    def read(self, length: int) -> bytes:
        """Exactly ``length`` bytes."""
        data = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data


def parse(stream: ReadDataStream) -> McapRecord:
    """The record that ``stream`` stands at; raises where its kind, or a length in it, is wrong."""
    opcode, length = stream.read1(), stream.read8()
    start = stream.count
    record = Message.read(stream, length) if opcode == Opcode.MESSAGE else PARSERS[opcode](stream)
    if stream.count - start != length:
        raise EndOfFile
    return record


def inside(chunk: Chunk) -> Iterator[tuple[int, McapRecord]]:
    """The records in a chunk, each with its offset when uncompressed; raises where its checksum differs."""
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    data, at = stream.read(length), 0
    while at < length:
        end = at + HEAD + int.from_bytes(data[at + 1 : at + HEAD], "little")
        if end > len(data):
            raise EndOfFile
        if data[at] == Opcode.MESSAGE:
            yield at, _message(data, at + HEAD, end)
        else:
            record = parse(ExactStream(BytesIO(data[at:end])))
            if not isinstance(record, Schema | Channel):
                raise TypeError(f"a chunk holds a {type(record).__name__}")
            yield at, record
        at = end


def _message(data: bytes, start: int, end: int) -> Message:
    """A message that stands in ``data``: of so many, the library's way, field by field, costs more than all else."""
    content = start + MESSAGE.size
    if content > end:
        raise EndOfFile
    channel_id, sequence, log_time, publish_time = MESSAGE.unpack_from(data, start)
    return Message(
        channel_id=channel_id,
        log_time=log_time,
        data=data[content:end],
        publish_time=publish_time,
        sequence=sequence,
    )


def packed(record: McapRecord) -> bytes:
    """A record as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]  # mcap leaves it without annotation
