"""Writes a run as one MCAP file that survives a crash with at most its last second missing.

Profile `ros2`, `ros2msg` schemas and `cdr` messages only, so that every ROS 2 tool opens it. World and metadata go in
first; a chunk is closed and handed to the operating system every second of log time, and synced to the disk if the
last time was about a second ago, so that nothing slows down a simulation. The bytes depend on what is written and on
nothing else.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import IO

from mcap.records import Message
from mcap.writer import Writer

from fusion import Diagnostic, LogError, Measurement, PluginError, Prior, Truth, Update, World
from fusion.values import nanoseconds
from logs import device_messages, messages
from logs.device_messages import ClockSync
from logs.messages import CODECS, ESTIMATE_TOPIC, FATES_TOPIC
from logs.schemas import SCHEMAS

RUN_RECORD = "fusion"
"""Name of the metadata record that makes an MCAP file one of ours."""
LIBRARY = "fusion"
"""Name of the writer in the header of a log."""
LOSS_NS = nanoseconds(1.0)
"""Largest loss by a crash, by the stamps of a log."""
FLUSH_NS = nanoseconds(0.9)
"""A little less than that, since what is received must still be written."""
SYNC_S = 0.8
"""Less than a flush is apart from the next, so that every one of a live recording is synced."""
FATES = "fusion_msgs/msg/Fates"


class RunWriter:
    """One log file, open for writing; a context manager. Not thread-safe: one thread owns it."""

    def __init__(
        self,
        path: Path,
        world: World,
        *,
        name: str,
        prior: Prior | None = None,
        metadata: Mapping[str, str] = MappingProxyType({}),
        attachments: Mapping[str, bytes] = MappingProxyType({}),
    ) -> None:
        """Start a log at ``path``, with files to keep in it by name; raises `LogError` where it cannot be written."""
        start, about = (b"", {}) if prior is None else messages.encode_prior(prior)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._stream: IO[bytes] = path.open("wb")
        except OSError as error:
            raise LogError(f"{path}: cannot be written ({error}); choose another place") from error
        self._path = path
        self._writer = Writer(self._stream)
        self._writer.start(profile="ros2", library=LIBRARY)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_ns: int | None = None
        self._synced_s = -math.inf
        record = {**metadata, **about, "name": name, "world": world.table, "world_hash": world.hash}
        self._writer.add_metadata(RUN_RECORD, record)
        self._writer.add_attachment(0, 0, "world.json", "application/json", world.table.encode())
        for title, content in attachments.items():
            self._writer.add_attachment(0, 0, title, "application/octet-stream", content)
        for codec in CODECS.values():
            self._channel(codec.topic, codec.schema)
        self._channel(*messages.TRUTH)
        if prior is not None:
            self._add(*messages.PRIOR, prior.time_ns, prior.time_ns, 0, start)

    def write(self, measurement: Measurement, *, log_time_ns: int | None = None) -> None:
        """Append a measurement; ``log_time_ns`` is when it arrived, if not when it was true."""
        codec = CODECS[type(measurement)]
        log_ns = measurement.time_ns if log_time_ns is None else log_time_ns
        self._add(codec.topic, codec.schema, log_ns, measurement.time_ns, measurement.seq, codec.encode(measurement))

    def write_truth(self, truth: Truth, *, log_time_ns: int | None = None) -> None:
        """Append a true pose; ``log_time_ns`` is when it arrived, if not when it was true."""
        log_ns = truth.time_ns if log_time_ns is None else log_time_ns
        self._add(*messages.TRUTH, log_ns, truth.time_ns, 0, messages.encode_truth(truth))

    def write_diagnostic(self, diagnostic: Diagnostic, *, log_time_ns: int | None = None) -> None:
        """Append a diagnostic of a device; ``log_time_ns`` is when it arrived."""
        log_ns = diagnostic.time_ns if log_time_ns is None else log_time_ns
        self._add(
            *device_messages.DIAGNOSTICS, log_ns, diagnostic.time_ns, 0, device_messages.encode_diagnostic(diagnostic)
        )

    def write_clock(self, sync: ClockSync) -> None:
        """Append one reading of all clocks of this computer."""
        self._add(*device_messages.CLOCKS, sync.boot_ns, sync.boot_ns, 0, device_messages.encode_clock(sync))

    def write_update(self, lane: str, update: Update, *, log_time_ns: int | None = None) -> None:
        """Append the update of an estimator: its estimate (if valid) and the fates of the readings; ``log_time_ns`` is
        when, if not at the time it is about. Raises `PluginError` for what no message can hold.
        """
        estimate, measurement = update.estimate, update.measurement
        stamp = estimate.time_ns
        log_ns = stamp if log_time_ns is None else log_time_ns
        try:
            message = messages.encode_estimate(estimate) if estimate.valid else b""
            fates = (
                messages.encode_fates(measurement.time_ns, measurement.sensor, update.fates) if update.fates else b""
            )
        except Exception as error:
            raise PluginError(
                f"{lane}: its update by {measurement.sensor!r} at {measurement.time_ns} ns fits no message "
                f"({error!r}); report it to its author"
            ) from error
        if message:
            schema = "geometry_msgs/msg/PoseWithCovarianceStamped"
            self._add(ESTIMATE_TOPIC + lane, schema, log_ns, stamp, 0, message)
        if fates:
            self._add(FATES_TOPIC + lane, FATES, log_ns, measurement.time_ns, measurement.seq, fates)

    def note(self, about: Mapping[str, str]) -> None:
        """Add to the metadata what was not known when the log was begun; what is there already is replaced."""
        try:
            self._writer.add_metadata(RUN_RECORD, dict(about))
        except OSError as error:
            raise LogError(f"{self._path}: could not be written ({error}); free some space") from error

    def copy(self, topic: str, schema: str, message: Message) -> None:
        """Append a message of another log as it stands; raises `LogError` for a type that no log of ours holds."""
        if schema not in SCHEMAS:
            raise LogError(f"{self._path}: {topic} is of type {schema!r}, which is none of ours; leave that file out")
        self._add(topic, schema, message.log_time, message.publish_time, message.sequence, message.data)

    def close(self) -> None:
        """Finish the file; nothing can be written afterwards."""
        if self._stream.closed:
            return
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it without annotation
            self._stream.flush()
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise LogError(f"{self._path}: could not be finished ({error}); free some space") from error
        finally:
            with suppress(OSError):  # what a full disk refused above, it refuses again here
                self._stream.close()

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _channel(self, topic: str, schema: str) -> int:
        if topic not in self._channels:
            if schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(schema, "ros2msg", SCHEMAS[schema].encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[schema])
        return self._channels[topic]

    def _add(self, topic: str, schema: str, log_ns: int, stamp_ns: int, seq: int, data: bytes) -> None:
        if log_ns < 0:
            raise LogError(f"{self._path}: {topic} received at {log_ns} ns, before time zero; shift the run's clock")
        if not 0 <= seq < 2**32:
            raise LogError(f"{self._path}: {topic} has number {seq}; a log counts from 0 to 2^32 - 1, number it so")
        try:
            self._writer.add_message(self._channel(topic, schema), log_ns, data, stamp_ns, seq)
            if self._flushed_ns is None or abs(log_ns - self._flushed_ns) >= FLUSH_NS:
                self._flushed_ns = log_ns
                self._flush()
        except OSError as error:
            raise LogError(f"{self._path}: could not be written ({error}); free some space") from error

    def _flush(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]  # mcap leaves it without annotation
        self._stream.flush()
        if time.monotonic() - self._synced_s >= SYNC_S:
            os.fsync(self._stream.fileno())
            self._synced_s = time.monotonic()
