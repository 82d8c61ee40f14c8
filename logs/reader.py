"""Reads a log back as a `Run`, whole or cut short.

A file that a crash cut off opens all the same: everything up to the last closed chunk is there, and a warning says
what is missing. The package's own message iterators answer such a file with nothing at all, hence the walk over raw
records.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fusion import Estimate, FusionError, LogError, Measurement, Truth, World
from logs import messages
from logs.messages import ESTIMATE_TOPIC, KINDS
from logs.run import Run, TruthTrack
from logs.writer import RUN_RECORD

MAGIC = b"\x89MCAP0\r\n"


@dataclass
class _Contents:
    """What the walk over a file has found so far."""

    record: dict[str, str] = field(default_factory=dict)
    measurements: list[tuple[int, Measurement]] = field(default_factory=list)
    truths: list[Truth] = field(default_factory=list)
    prior: bytes | None = None
    lanes: dict[str, list[Estimate]] = field(default_factory=dict)
    unreadable: dict[str, int] = field(default_factory=dict)
    foreign: dict[str, int] = field(default_factory=dict)
    cut_off: str = ""


def read_run(path: Path) -> Run:
    """The run in the log at ``path``; raises `LogError` for a file that holds none."""
    contents = _walk(path)
    world = _world(path, contents)
    contents.measurements.sort(key=lambda item: item[0])
    prior = None
    if contents.prior is not None:
        known = {key: contents.record.get(key, "true") == "true" for key in ("position_known", "heading_known")}
        prior = messages.decode_prior(contents.prior, **known)
    return Run(
        path=path,
        name=contents.record.get("name", path.stem),
        world=world,
        prior=prior,
        metadata={key: value for key, value in contents.record.items() if key != "world"},
        measurements=tuple(measurement for _, measurement in contents.measurements),
        truth=TruthTrack.from_truths(contents.truths) if contents.truths else None,
        warnings=_warnings(path, contents),
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
        try:
            for record in StreamReader(stream, record_size_limit=None).records:
                if isinstance(record, Message):
                    _take(contents, *channels[record.channel_id], record)
                elif isinstance(record, Schema):
                    schemas[record.id] = record.name
                elif isinstance(record, Channel):
                    channels[record.id] = (record.topic, schemas.get(record.schema_id, ""))
                elif isinstance(record, Metadata) and record.name == RUN_RECORD:
                    contents.record.update(record.metadata)
        except Exception as error:  # noqa: BLE001 - a damaged tail fails in any of a dozen ways, and all mean "cut off"
            contents.cut_off = f"{type(error).__name__} after {len(contents.measurements)} measurements"
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
    decoders: dict[str, Callable[[bytes, int], Measurement]] = {kind.schema: kind.decode for kind in KINDS.values()}
    try:
        if topic == messages.TRUTH[0]:
            contents.truths.append(messages.decode_truth(message.data))
        elif topic == messages.PRIOR[0]:
            contents.prior = message.data
        elif topic.startswith(ESTIMATE_TOPIC):
            lane = contents.lanes.setdefault(topic.removeprefix(ESTIMATE_TOPIC), [])
            lane.append(messages.decode_estimate(message.data))
        elif schema in decoders:
            contents.measurements.append((message.log_time, decoders[schema](message.data, message.sequence)))
        else:
            contents.foreign[topic] = contents.foreign.get(topic, 0) + 1
    except Exception:  # noqa: BLE001 - whatever is wrong with one message, the others still count
        contents.unreadable[topic] = contents.unreadable.get(topic, 0) + 1


def _warnings(path: Path, contents: _Contents) -> tuple[str, ...]:
    found = []
    if contents.cut_off:
        found.append(f"{path}: the file is cut off ({contents.cut_off}); what was written before is used")
    found += [f"{path}: {count} messages of {topic} cannot be decoded" for topic, count in contents.unreadable.items()]
    if not contents.measurements:
        found.append(f"{path}: holds no measurements")
    return tuple(found)
