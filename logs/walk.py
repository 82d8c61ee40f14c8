"""One walk over an MCAP file, whole or cut short: ours, or anybody's.

A file that a crash cut off opens all the same: everything up to the last closed chunk is there, and a warning says
what is missing. The package's own message iterators answer such a file with nothing at all, hence the walk over raw
records.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from fusion import LogError

MAGIC = b"\x89MCAP0\r\n"


class Source(NamedTuple):
    """Where a message comes from: its topic, its type, how it is packed, and the type's definition as the file has it
    (text of `ros2msg`, a protobuf FileDescriptorSet, a JSON schema).
    """

    topic: str
    type: str
    encoding: str
    definition: bytes


class Walk:
    """The messages of a file in the order they stand in it, for one iteration.

    ``sources``, ``metadata`` (records by name) and ``damage`` grow as the walk goes on; ``damage`` stays empty for a
    file that is whole. Raises `LogError`, on iteration, for a file that cannot be opened or is no MCAP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.sources: dict[int, Source] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.damage = ""

    def __iter__(self) -> Iterator[tuple[Source, Message]]:
        with _open(self.path) as stream:
            size = self.path.stat().st_size
            readable = len(MAGIC)
            schemas: dict[int, Schema] = {}
            try:
                for record in StreamReader(stream, validate_crcs=True, record_size_limit=size).records:
                    readable = stream.tell()
                    if isinstance(record, Message):
                        yield self.sources[record.channel_id], record
                    elif isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        self.sources[record.id] = _source(record, schemas.get(record.schema_id))
                    elif isinstance(record, Metadata):
                        self.metadata.setdefault(record.name, {}).update(record.metadata)
            except Exception as error:  # noqa: BLE001 - damage shows in any of a dozen ways: "nothing further"
                self.damage = f"the last {size - readable} of its {size} bytes ({type(error).__name__})"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the walk could not read, in a sentence; empty for a file that is whole."""
        if not self.damage:
            return ()
        return (f"{self.path}: cut off or damaged, {self.damage} cannot be read; what stands before is used",)


def _source(channel: Channel, schema: Schema | None) -> Source:
    if schema is None:
        return Source(channel.topic, "", channel.message_encoding, b"")
    return Source(channel.topic, schema.name, channel.message_encoding, schema.data)


def _open(path: Path) -> IO[bytes]:
    try:
        stream = path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: cannot be opened ({error.strerror}); check the path") from error
    start = stream.read(len(MAGIC))
    stream.seek(0)
    if start != MAGIC:
        stream.close()
        what = "is empty" if not start else "is no MCAP file"
        raise LogError(f"{path}: {what}; give a log, or bring a recording in with `fusion import`")
    return stream
