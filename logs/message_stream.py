"""One walk over the messages of an MCAP file, whole or damaged: ours, or anybody's.

A file that a crash cut off opens all the same, and so does one with a damaged chunk in the middle: what is sound is
there, and a warning states what is missing. The package's own message iterators answer such a file with nothing at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from mcap.records import Channel, Message, Metadata, Schema

from fusion import LogError
from logs.salvage.damage import Damage
from logs.salvage.records import MAGIC
from logs.salvage.scan import Salvage

REPAIR_RECORD = "fusion repair"
"""Name of the metadata record in which a repaired file states what it has lost."""


class Source(NamedTuple):
    """Origin of a message: its topic, its type, its encoding, and the type's definition as the file has it
    (text of `ros2msg`, a protobuf FileDescriptorSet, a JSON schema).
    """

    topic: str
    type: str
    encoding: str
    definition: bytes


class Walk:
    """The messages of a file in the order they stand in it, for one iteration.

    ``sources`` and ``metadata`` (records by name) grow as the walk goes on; ``damage`` is there after it. Raises
    `LogError`, on iteration, for a file that cannot be opened or is no MCAP.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.sources: dict[int, Source] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.damage: Damage | None = None

    def __iter__(self) -> Iterator[tuple[Source, Message]]:
        with open_mcap(self.path) as stream:
            schemas: dict[int, Schema] = {}
            salvage = Salvage(stream)
            for record in (record for piece in salvage for record in piece.records):
                if isinstance(record, Message):
                    yield self.sources[record.channel_id], record
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    self.sources[record.id] = _source(record, schemas.get(record.schema_id))
                elif isinstance(record, Metadata):
                    self.metadata.setdefault(record.name, {}).update(record.metadata)
            self.damage = salvage.damage

    @property
    def warnings(self) -> tuple[str, ...]:
        """Losses of the walk and of a repair before it, a sentence each; empty for a file that is whole."""
        warnings = []
        if lost := self.metadata.get(REPAIR_RECORD, {}).get("lost"):
            warnings.append(f"{self.path}: was repaired; it had been {lost}")
        if self.damage and str(self.damage):
            remedy = f"`fusion repair {self.path} -o GOOD.mcap` makes a whole file of the rest"
            warnings.append(f"{self.path}: {self.damage}; {remedy}")
        return tuple(warnings)


def _source(channel: Channel, schema: Schema | None) -> Source:
    if schema is None:
        return Source(channel.topic, "", channel.message_encoding, b"")
    return Source(channel.topic, schema.name, channel.message_encoding, schema.data)


def open_mcap(path: Path) -> IO[bytes]:
    """The file, open for reading; raises `LogError` for one that cannot be opened or is no MCAP."""
    try:
        stream = path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: cannot be opened ({error.strerror}); check the path") from error
    if not stream.seekable():
        stream.close()
        raise LogError(f"{path}: is a pipe, and a log is read from more than one place; give a file")
    start = stream.read(len(MAGIC))
    stream.seek(0)
    if start != MAGIC:
        stream.close()
        what = "is empty" if not start else "is no MCAP file"
        raise LogError(f"{path}: {what}; give a log, or bring a recording in with `fusion import`")
    return stream
