"""The sound records of an MCAP file and what is damaged between them: one walk, for reading and for repair.

A damaged chunk costs that chunk only: the walk goes on where the next record begins by its length, if one stands
there, or else at the next place that the file's index knows. It ends at a length beyond the file (the placeholder of a
chunk that was being written is 2^64 - 1), at zeros, and wherever nothing sound follows. Everything is checked that
carries a check: the CRC of chunks, attachments and the whole, the lengths inside every record, and the channels.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from io import BytesIO
from itertools import chain
from typing import IO

from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Schema
from mcap.summary import Summary

from logs.salvage.damage import Damage, Hole
from logs.salvage.records import HEAD, MAGIC, PARSERS, ExactStream, Piece, inside, packed, parse
from logs.writer import LIBRARY, LOSS_NS

DATA_END = HEAD + 4
FOOTER = HEAD + 8 + 8 + 4
"""Bytes of these records, their heads included."""


class Salvage:
    """The sound pieces of the MCAP file open in ``stream``, for one iteration; `damage` is complete after it."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._size = stream.seek(0, os.SEEK_END)
        self._summary, self._places = _read_summary(stream, self._size)
        self._schemas: set[int] = set()
        self._channels: set[int] = set()
        self._holes: list[Hole] = []
        self._finished = False
        self._is_chunked = False
        self._writer = ""
        self._crc = zlib.crc32(MAGIC)
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self.messages = 0
        """Messages met so far."""

    def __iter__(self) -> Iterator[Piece]:
        at: int | None = len(MAGIC)
        while at is not None:
            try:
                piece = self._piece(at)
                absent = self._absent(piece)
            except Exception as error:  # noqa: BLE001 - damage shows in any of a dozen ways
                at = self._pass_over(at, error)
                continue
            if isinstance(piece.record, DataEnd):
                self._finish(piece.record, at)
                return
            at += len(piece.raw)
            self._crc = zlib.crc32(piece.raw, self._crc)
            self._note(piece)
            yield from absent
            yield piece

    @property
    def damage(self) -> Damage:
        """Damage of the file, as far as it was walked."""
        statistics = self._summary and self._summary.statistics
        return Damage(
            size=self._size,
            holes=tuple(self._holes),
            finished=self._finished,
            indexed=self._summary is not None,
            missing=max(statistics.message_count - self.messages, 0) if statistics else None,
            first_ns=self._first_ns,
            writer=self._writer,
            flush_ns=LOSS_NS if self._writer == LIBRARY else None,
        )

    def _end(self, at: int) -> int | None:
        """End of the record at ``at`` by its own length; None where no record can stand."""
        self._stream.seek(at)
        head = ExactStream(BytesIO(self._stream.read(HEAD)))
        try:
            opcode, end = head.read1(), at + HEAD + head.read8()
        except EndOfFile:
            return None
        return end if opcode and end <= self._size else None

    def _piece(self, at: int) -> Piece:
        end = self._end(at)
        if end is None:
            raise EndOfFile
        self._stream.seek(at)
        raw = self._stream.read(end - at)
        record = parse(ExactStream(BytesIO(raw)))
        if isinstance(record, Attachment):
            _check(zlib.crc32(raw[HEAD:-4]), int.from_bytes(raw[-4:], "little"))
        if isinstance(record, Message) and self._is_chunked:
            # Writers use chunks or do not. Between chunks this is an index, one flipped bit away from a message.
            raise TypeError("a message stands between chunks")
        return Piece(raw, record, list(inside(record)) if isinstance(record, Chunk) else [])

    def _absent(self, piece: Piece) -> list[Piece]:
        """Schemas and channels that a piece needs and only the index has; raises `KeyError` where nobody has them."""
        summary = self._summary or Summary()
        schemas, channels, absent = set(self._schemas), set(self._channels), []

        def need_schema(channel: Channel) -> None:
            if channel.schema_id and channel.schema_id not in schemas:
                schemas.add(channel.schema_id)
                absent.append(_repeated(summary.schemas[channel.schema_id]))

        for record in piece.records:
            if isinstance(record, Schema):
                schemas.add(record.id)
            elif isinstance(record, Channel):
                need_schema(record)
                channels.add(record.id)
            elif isinstance(record, Message) and record.channel_id not in channels:
                need_schema(summary.channels[record.channel_id])
                channels.add(record.channel_id)
                absent.append(_repeated(summary.channels[record.channel_id]))
        self._schemas, self._channels = schemas, channels
        return absent

    def _note(self, piece: Piece) -> None:
        self._is_chunked |= isinstance(piece.record, Chunk)
        if isinstance(piece.record, Header):
            self._writer = piece.record.library
        times = [record.log_time for record in piece.records if isinstance(record, Message)]
        if times:
            self.messages += len(times)
            self._close(min(times))
            self._first_ns = min(times) if self._first_ns is None else min(self._first_ns, *times)
            self._last_ns = max(times) if self._last_ns is None else max(self._last_ns, *times)

    def _close(self, time_ns: int) -> None:
        """Messages go on, or would have ended, at this time: holes that are open reach up to here."""
        for i, hole in enumerate(self._holes):
            if hole.until_ns is None:
                self._holes[i] = hole._replace(until_ns=time_ns)

    def _pass_over(self, at: int, error: Exception) -> int | None:
        """Note a hole at ``at`` and answer where the walk goes on, if anywhere."""
        places = chain([self._end(at)], (place for place in self._places if place > at))
        following = next((place for place in places if place and self._stands_at(place)), None)
        stated_ns = self._stated_ns(at) if following is None else None
        end = self._size if following is None else following
        self._holes.append(Hole(at, end, type(error).__name__, self._last_ns, stated_ns=stated_ns))
        return following

    def _stands_at(self, place: int) -> bool:
        """Whether a record of a kind that may stand there does, going by its head."""
        self._stream.seek(place)
        opcode = self._stream.read(1)
        return bool(opcode) and (opcode[0] in PARSERS or opcode[0] == Opcode.MESSAGE) and self._end(place) is not None

    def _stated_ns(self, at: int) -> int | None:
        """Time of the last message by the head of a half written chunk, None where it cannot be one."""
        self._stream.seek(at)
        head = ExactStream(BytesIO(self._stream.read(HEAD + 16)))
        try:
            opcode, _, start_ns, end_ns = head.read1(), head.read8(), head.read8(), head.read8()
        except EndOfFile:
            return None
        return end_ns if opcode == Opcode.CHUNK and (self._last_ns or 0) <= start_ns <= end_ns else None

    def _finish(self, record: DataEnd, at: int) -> None:
        self._finished = True
        if self._summary and self._summary.statistics and self._summary.statistics.message_count:
            self._close(self._summary.statistics.message_end_time)
        if record.data_section_crc not in (0, self._crc) and not self._holes:
            self._holes.append(Hole(at, at, "the checksum of the whole differs", self._first_ns, self._last_ns))


def _repeated(record: McapRecord) -> Piece:
    return Piece(packed(record), record, [])


def _check(actual: int, expected: int) -> None:
    if expected not in (0, actual):
        raise ValueError(f"checksum {actual} is not {expected}")


def _read_summary(stream: IO[bytes], size: int) -> tuple[Summary | None, list[int]]:
    """The index at the end of a file and the places of records it knows; None where it is not whole."""
    try:
        stream.seek(size - FOOTER - len(MAGIC))
        footer = _parse_footer(stream.read(FOOTER))
        if stream.read() != MAGIC:
            return None, []
        start = footer.summary_start or size - FOOTER - len(MAGIC)
        stream.seek(start)
        _check(zlib.crc32(stream.read(size - len(MAGIC) - 4 - start)), footer.summary_crc)
        stream.seek(0)
        summary = SeekingReader(stream, record_size_limit=size).get_summary() or Summary()
    except Exception:  # noqa: BLE001 - whatever is wrong with it, it cannot be used
        return None, []
    places = {chunk.chunk_start_offset for chunk in summary.chunk_indexes}
    places |= {attachment.offset for attachment in summary.attachment_indexes}
    places |= {metadata.offset for metadata in summary.metadata_indexes}
    return summary, sorted({*places, start - DATA_END})


def _parse_footer(raw: bytes) -> Footer:
    stream = ExactStream(BytesIO(raw))
    if stream.read1() != Opcode.FOOTER or stream.read8() != FOOTER - HEAD:
        raise EndOfFile
    footer: Footer = Footer.read(stream)
    return footer
