"""Reads a log back as a `Run`, whole or cut short.

A file that a crash cut off opens all the same: everything up to the last closed chunk is there, and a warning says
what is missing. The package's own message iterators answer such a file with nothing at all, hence the walk over raw
records.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusion import Estimate, FusionError, LogError, Measurement, Prior, Truth, World
from logs import messages
from logs.messages import DECODERS, ESTIMATE_TOPIC, FATES_TOPIC
from logs.run import Run, TruthTrack
from logs.writer import RUN_RECORD

MAGIC = b"\x89MCAP0\r\n"


@dataclass
class _Contents:
    """What the walk over a file has found so far."""

    record: dict[str, str] = field(default_factory=dict)
    measurements: list[tuple[int, Measurement]] = field(default_factory=list)
    truths: list[Truth] = field(default_factory=list)
    prior: Prior | None = None
    lanes: dict[str, list[Estimate]] = field(default_factory=dict)
    unreadable: dict[str, int] = field(default_factory=dict)
    foreign: dict[str, int] = field(default_factory=dict)
    damage: str = ""


def read_run(path: Path) -> Run:
    """The run in the log at ``path``; raises `LogError` for a file that holds none."""
    contents = _walk(path)
    world = _world(path, contents)
    if not (contents.measurements or contents.truths or contents.lanes):
        raise LogError(f"{path}: holds no messages, or none that can be read; record or import it again")
    contents.measurements.sort(key=lambda item: item[0])
    return Run(
        path=path,
        name=contents.record.get("name", path.stem),
        world=world,
        prior=contents.prior,
        metadata={key: value for key, value in contents.record.items() if key != "world"},
        measurements=tuple(measurement for _, measurement in contents.measurements),
        truth=TruthTrack.from_truths(contents.truths) if contents.truths else None,
        warnings=_warnings(path, contents, world),
        lanes={name: tuple(estimates) for name, estimates in contents.lanes.items()},
    )


def _world(path: Path, contents: _Contents) -> World:
    """The world stored in the log; its absence means that the file is not one of ours."""
    if "world" not in contents.record:
        topics = ", ".join(contents.foreign) or "nothing readable"
        raise LogError(
            f"{path}: holds no world ({topics}); record it with fusion, or bring it in with `fusion import csv`"
        )
    try:
        return World.from_table(json.loads(contents.record["world"]))
    except (FusionError, ValueError) as error:
        raise LogError(f"{path}: the world stored in it cannot be read ({error}); record or import it again") from error


def _walk(path: Path) -> _Contents:
    from mcap.records import Channel, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader

    contents = _Contents()
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    with _open(path) as stream:
        size = path.stat().st_size
        readable = len(MAGIC)
        try:
            for record in StreamReader(stream, validate_crcs=True, record_size_limit=size).records:
                readable = stream.tell()
                if isinstance(record, Message):
                    _take(contents, *channels[record.channel_id], record)
                elif isinstance(record, Schema):
                    schemas[record.id] = record.name
                elif isinstance(record, Channel):
                    channels[record.id] = (record.topic, schemas.get(record.schema_id, ""))
                elif isinstance(record, Metadata) and record.name == RUN_RECORD:
                    contents.record.update(record.metadata)
        except Exception as error:  # noqa: BLE001 - damage shows in any of a dozen ways, and all mean "nothing further"
            contents.damage = f"the last {size - readable} of its {size} bytes ({type(error).__name__})"
    return contents


def _open(path: Path) -> Any:  # noqa: ANN401 - a binary stream
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


def _take(contents: _Contents, topic: str, schema: str, message: Any) -> None:  # noqa: ANN401 - an MCAP message
    """Sort one message into the contents; one that cannot be decoded is counted, not fatal."""
    try:
        if topic == messages.TRUTH[0]:
            contents.truths.append(messages.decode_truth(message.data))
        elif topic == messages.PRIOR[0]:
            contents.prior = messages.decode_prior(message.data, contents.record)
        elif topic.startswith(ESTIMATE_TOPIC):
            estimate = messages.decode_estimate(message.data)
            contents.lanes.setdefault(topic.removeprefix(ESTIMATE_TOPIC), []).append(estimate)
        elif schema in DECODERS:
            contents.measurements.append((message.log_time, DECODERS[schema](message.data, message.sequence)))
        elif not topic.startswith(FATES_TOPIC):
            contents.foreign[topic] = contents.foreign.get(topic, 0) + 1
    except Exception:  # noqa: BLE001 - whatever is wrong with one message, the others still count
        contents.unreadable[topic] = contents.unreadable.get(topic, 0) + 1


def _warnings(path: Path, contents: _Contents, world: World) -> tuple[str, ...]:
    found = []
    if contents.damage:
        found.append(f"{path}: cut off or damaged, {contents.damage} cannot be read; what stands before is used")
    if contents.record.get("world_hash", world.hash) != world.hash:
        found.append(f"{path}: the world stored in it is not the one it was written with; its hash differs")
    found += [f"{path}: {count} messages of {topic} cannot be decoded" for topic, count in contents.unreadable.items()]
    found += [f"{path}: {count} messages of {topic} are of no use here" for topic, count in contents.foreign.items()]
    if not contents.measurements:
        found.append(f"{path}: holds no measurements")
    return tuple(found)
