"""Puts an MCAP file together from sound pieces: every one byte for byte as it was, the index anew.

Chunks keep their bytes; message indexes, summary and footer are built by walking what is really there.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from typing import IO

from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from logs.salvage.records import MAGIC, Piece, packed


class Rebuilder:
    """One MCAP file, written into ``stream`` piece by piece. The first must hold a header; `finish` completes it."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._start_ns: int | None = None
        self._end_ns = 0
        self._has_header = False
        stream.write(MAGIC)

    def add(self, piece: Piece) -> None:
        """Copy a piece; old message indexes are left out, and a second header."""
        record = piece.record
        if isinstance(record, MessageIndex) or (isinstance(record, Header) and self._has_header):
            return
        if not self._has_header and not isinstance(record, Header):
            self.add_record(Header(profile="", library=""))
        self._has_header = True
        start = self._stream.tell()
        self._stream.write(piece.raw)
        for inner in piece.records:
            self._count(inner)
        if isinstance(record, Chunk):
            self._index_chunk(record, piece, start)
        elif isinstance(record, Attachment):
            about = (record.log_time, record.create_time, len(record.data), record.name, record.media_type)
            self._attachments.append(AttachmentIndex(start, len(piece.raw), *about))
        elif isinstance(record, Metadata):
            self._metadata.append(MetadataIndex(start, len(piece.raw), record.name))

    def add_record(self, record: McapRecord) -> None:
        """Add a record that the damaged file did not have."""
        self.add(Piece(packed(record), record, []))

    def finish(self) -> None:
        """Write the end of the data, the summary, the footer."""
        self._stream.write(packed(DataEnd(0)))
        start = self._stream.tell()
        summary, offsets = b"", b""
        for group in self._groups():
            content = b"".join(map(packed, group))
            if content:
                offsets += packed(SummaryOffset(content[0], start + len(summary), len(content)))
            summary += content
        footer = packed(Footer(start, start + len(summary), 0))[:-4]
        checksum = zlib.crc32(summary + offsets + footer)
        self._stream.write(summary + offsets + footer + checksum.to_bytes(4, "little") + MAGIC)

    def _count(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Message):
            self._counts[record.channel_id] = self._counts.get(record.channel_id, 0) + 1
            self._start_ns = record.log_time if self._start_ns is None else min(self._start_ns, record.log_time)
            self._end_ns = max(self._end_ns, record.log_time)

    def _index_chunk(self, chunk: Chunk, piece: Piece, start: int) -> None:
        indexes: dict[int, MessageIndex] = {}
        for offset, record in piece.inside:
            if isinstance(record, Message):
                index = indexes.setdefault(record.channel_id, MessageIndex(record.channel_id, []))
                index.records.append((record.log_time, offset))
        offsets = {}
        for channel_id, index in indexes.items():
            offsets[channel_id] = self._stream.tell()
            self._stream.write(packed(index))
        times = [time_ns for index in indexes.values() for time_ns, _ in index.records]
        self._chunks.append(
            ChunkIndex(
                chunk_length=len(piece.raw),
                chunk_start_offset=start,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=max(times, default=0),
                message_index_length=self._stream.tell() - start - len(piece.raw),
                message_index_offsets=offsets,
                message_start_time=min(times, default=0),
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def _groups(self) -> Iterable[Iterable[McapRecord]]:
        """The records of the summary, kind by kind."""
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self._end_ns,
            message_start_time=self._start_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        named = self._schemas.values(), self._channels.values()
        return (*named, [statistics], self._chunks, self._attachments, self._metadata)
