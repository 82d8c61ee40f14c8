"""Reads a log of ours back as a `Run`, whole or cut short."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from mcap.records import Message

from fusion import BeliefError, Diagnostic, Estimate, FusionError, LogError, Measurement, Prior, Truth, World
from logs import device_messages, messages
from logs.device_messages import ClockSync
from logs.message_stream import Walk
from logs.messages import DECODERS, ESTIMATE_TOPIC, FATES_TOPIC
from logs.run import Run, left_out
from logs.salvage.damage import Damage
from logs.truth import TruthTrack
from logs.wheel_direction import caution_of_run
from logs.writer import RUN_RECORD


@dataclass
class _Contents:
    """Content of a file as far as it was walked."""

    record: dict[str, str]
    measurements: list[tuple[int, Measurement]] = field(default_factory=list)
    truths: list[Truth] = field(default_factory=list)
    prior: Prior | None = None
    lanes: dict[str, list[Estimate]] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    clocks: list[ClockSync] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    unreadable: dict[str, int] = field(default_factory=dict)
    foreign: dict[str, int] = field(default_factory=dict)


class Log(NamedTuple):
    """A run, and what only its file holds: the measurements in the order they stand there, each after
    its log time [ns], and what is damaged.
    """

    run: Run
    arrivals: Sequence[tuple[int, Measurement]]
    damage: Damage | None


def read_run(path: Path) -> Run:
    """The run in the log at ``path``; raises `LogError` for a file that holds none."""
    return read_log(path).run


def read_log(path: Path) -> Log:
    """The run in the log at ``path``, and more about the file; raises `LogError` for a file that holds none."""
    walk = Walk(path)
    contents = _contents(walk)
    world = _world(path, contents)
    if not (contents.measurements or contents.truths or contents.lanes or contents.clocks or contents.prior):
        raise LogError(f"{path}: holds no messages, or none that can be read; record or import it again")
    run = Run(
        path=path,
        name=contents.record.get("name", path.stem),
        world=world,
        prior=contents.prior,
        metadata={key: value for key, value in contents.record.items() if key != "world"},
        measurements=tuple(item[1] for item in sorted(contents.measurements, key=lambda item: item[0])),
        truth=TruthTrack.from_truths(contents.truths) or None,
        warnings=(*walk.warnings, *_warnings(path, contents, world), *_cautions(path, contents, world)),
        lanes={name: tuple(estimates) for name, estimates in contents.lanes.items()},
        diagnostics=tuple(contents.diagnostics),
        clocks=tuple(contents.clocks),
    )
    return Log(run, contents.measurements, walk.damage)


def _world(path: Path, contents: _Contents) -> World:
    """The world stored in the log; its absence means that the file is not one of ours."""
    if "world" not in contents.record:
        topics = ", ".join(contents.foreign) or "nothing readable"
        raise LogError(
            f"{path}: holds no world ({topics}); record it with fusion, or bring it in with `fusion import rosbag`"
        )
    try:
        return World.from_table(json.loads(contents.record["world"]))
    except (FusionError, ValueError) as error:
        raise LogError(f"{path}: the world stored in it cannot be read ({error}); record or import it again") from error


def read_world(path: Path) -> World:
    """The world of the log at ``path``, which stands before its first message; raises as `read_run`."""
    walk = Walk(path)
    next(iter(walk), None)
    return _world(path, _Contents(walk.metadata.get(RUN_RECORD, {})))


def holds_run(path: Path) -> bool:
    """Whether the file is a log of ours: it states so before its first message. Raises `LogError` for no MCAP file."""
    walk = Walk(path)
    next(iter(walk), None)
    return "world" in walk.metadata.get(RUN_RECORD, {})


def _contents(walk: Walk) -> _Contents:
    contents = _Contents(walk.metadata.setdefault(RUN_RECORD, {}))
    for source, message in walk:
        _take(contents, source.topic, source.type, message)
    return contents


def _take(contents: _Contents, topic: str, schema: str, message: Message) -> None:
    """Sort one message into the contents; one that cannot be decoded is counted, not fatal."""
    try:
        if topic == messages.TRUTH[0]:
            contents.truths.append(messages.decode_truth(message.data))
        elif topic == messages.PRIOR[0]:
            _take_prior(contents, message.data)
        elif topic.startswith(ESTIMATE_TOPIC):
            estimate = messages.decode_estimate(message.data)
            contents.lanes.setdefault(topic.removeprefix(ESTIMATE_TOPIC), []).append(estimate)
        elif topic == device_messages.DIAGNOSTICS[0]:
            contents.diagnostics.append(device_messages.decode_diagnostic(message.data))
        elif topic == device_messages.CLOCKS[0]:
            contents.clocks.append(device_messages.decode_clock(message.data))
        elif schema in DECODERS:
            contents.measurements.append((message.log_time, DECODERS[schema](message.data, message.sequence)))
        elif not topic.startswith(FATES_TOPIC):
            contents.foreign[topic] = contents.foreign.get(topic, 0) + 1
    except Exception:  # noqa: BLE001 - whatever is wrong with one message, the others still count
        contents.unreadable[topic] = contents.unreadable.get(topic, 0) + 1


def _take_prior(contents: _Contents, data: bytes) -> None:
    """A prior that no estimator could start from is as good as none: the start then comes from the truth."""
    try:
        contents.prior = messages.decode_prior(data, contents.record)
    except BeliefError as error:
        contents.refused.append(f"its starting prior is left out ({error})")


def _warnings(path: Path, contents: _Contents, world: World) -> tuple[str, ...]:
    warnings = []
    if contents.record.get("world_hash", world.hash) != world.hash:
        warnings.append(f"{path}: the world stored in it is not the one it was written with; its hash differs")
    uncounted = left_out([truth.position_known for truth in contents.truths])
    warnings += [f"{path}: {sentence}" for sentence in (*contents.refused, *uncounted)]
    warnings += [
        f"{path}: {count} messages of {topic} cannot be decoded" for topic, count in contents.unreadable.items()
    ]
    warnings += [f"{path}: {count} messages of {topic} are of no use here" for topic, count in contents.foreign.items()]
    if not contents.measurements:
        warnings.append(f"{path}: holds no measurements")
    return tuple(warnings)


def _cautions(path: Path, contents: _Contents, world: World) -> Iterator[str]:
    """Warnings of a run that is misleading though all of it can be read."""
    measurements = [measurement for _, measurement in contents.measurements]
    if caution := caution_of_run(world.robot, measurements, contents.diagnostics):
        # A later part of a recording begins with a command that stands in an earlier one.
        if contents.record.get("split", "0") != "0":
            caution = caution._replace(cure="join the parts of the recording (`fusion join`)")
        yield f"{path}: {caution}"
