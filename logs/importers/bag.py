"""A bag of anybody's making, topic by topic: how much came when, and what of it can be read.

A bag is one MCAP file, or the folder of a rosbag2 recording with one or more of them. Messages that cannot be decoded
are counted; types that nobody here understands are counted too, and not decoded.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Message

from fusion import LogError, Ranges
from fusion.values import seconds
from logs.importers import foxglove
from logs.importers.samples import CDR, TRANSFORMS, Decoder, JointSample, PoseSample, RangeSample, Sample
from logs.message_stream import Source, Walk

Keep = Callable[[str, Sample], bool]
NEEDS_PROTOBUF = "its protobuf messages need the package protobuf; pip install 'fusion-localization[foxglove]'"
FOXGLOVE = ("json", "protobuf")
"""Encodings of messages of Foxglove's types."""
TRANSFORM_TYPES = (TRANSFORMS, foxglove.TRANSFORM, foxglove.TRANSFORMS)


@dataclass
class Topic:
    """One topic: its type, how many messages arrived from when to when (log time [ns]), and the samples kept of them,
    each with the time it arrived. ``names``: frames (``parent>child`` of transforms), anchors or joints.
    """

    name: str
    type: str
    encoding: str
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    samples: list[tuple[int, Sample]] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    unreadable: int = 0
    missing: str = ""
    """The remedy for a package without which its messages cannot be read; "" where none is missing."""

    @property
    def understood(self) -> bool:
        """Whether messages of its type are read here, packed as they are."""
        return self.type in (CDR if self.encoding == "cdr" else foxglove.READERS if self.encoding in FOXGLOVE else ())

    @property
    def rate_hz(self) -> float | None:
        """Messages per second of log time; None for one message, or all at once."""
        span_s = seconds(self.last_ns - self.first_ns)
        return (self.count - 1) / span_s if span_s > 0.0 else None


@dataclass
class Bag:
    """Content of a bag. Topics by name, in the order they were met."""

    path: Path
    topics: dict[str, Topic] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    """Damage of its files, a sentence each."""
    decoders: dict[Source, Decoder] = field(default_factory=dict, repr=False)

    def topic(self, source: Source) -> Topic:
        """The topic of a source, new if it was not met yet."""
        return self.topics.setdefault(source.topic, Topic(source.topic, source.type, source.encoding))

    def take(self, source: Source, message: Message, keep: Keep) -> None:
        """Count a message, and keep its samples if they are wanted."""
        topic = self.topic(source)
        topic.count += 1
        topic.first_ns = message.log_time if topic.count == 1 else min(topic.first_ns, message.log_time)
        topic.last_ns = max(topic.last_ns, message.log_time)
        try:
            for sample in self._decoded(topic, source, message.data):
                topic.names.update(_names(topic.type, sample))
                if keep(topic.type, sample):
                    topic.samples.append((message.log_time, sample))
        except ModuleNotFoundError:
            topic.missing = NEEDS_PROTOBUF
        except Exception:  # noqa: BLE001 - whatever is wrong with one message, the others still count
            topic.unreadable += 1

    def _decoded(self, topic: Topic, source: Source, data: bytes) -> Iterable[Sample]:
        if topic.missing or not topic.understood:
            return ()
        if (source.type, source.encoding) != (topic.type, topic.encoding):
            raise ValueError(f"the topic changes from {topic.type} to {source.type}")
        if source not in self.decoders:
            self.decoders[source] = _decoder(source)
        return self.decoders[source](data)


def open_bag(path: Path, *, keep: Keep) -> Bag:
    """The bag at ``path``, with those samples that ``keep`` (given the message's type) wants; raises `LogError`."""
    bag = Bag(path)
    for file in _files(path):
        walk = Walk(file)
        for source, message in walk:
            bag.take(source, message, keep)
        for source in walk.sources.values():
            bag.topic(source)
        bag.warnings += walk.warnings
    return bag


def _files(path: Path) -> list[Path]:
    """The MCAP files of a bag, in the order of their numbers."""
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=lambda file: [int(part) for part in re.findall(r"\d+", file.stem)])
    if not files:
        raise LogError(f"{path}: holds no *.mcap; convert the bag first (`ros2 bag convert`, or rosbags-convert)")
    return files


def _decoder(source: Source) -> Decoder:
    """The decoder for the messages of an understood topic."""
    if source.encoding == "cdr":
        return CDR[source.type]
    if source.encoding == "json":
        return foxglove.json_decoder(source.type)
    return foxglove.protobuf_decoder(source.type, source.definition)


def _names(kind: str, sample: Sample) -> Iterable[str]:
    """Names of the frames, joints or anchors in a sample."""
    if isinstance(sample, PoseSample):
        return (f"{sample.parent}>{sample.child}" if kind in TRANSFORM_TYPES else sample.parent,)
    if isinstance(sample, RangeSample):
        return (sample.frame,)
    if isinstance(sample, JointSample):
        return sample.angles
    if isinstance(sample, Ranges):
        return [reading.anchor for reading in sample.readings]
    return ()
