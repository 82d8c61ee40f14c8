"""The measurements of a run, laid out in columns for faults to write into, and put together again as a `Run`.

Rows are never taken out, only marked as not kept. So row i is always the i-th message, or reading, of the run, whatever
faults came before: random numbers that belong to rows stay with them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.row_selection import TOPICS, RowSelection, it_has
from fusion import (
    Gyro,
    Measurement,
    MeasurementError,
    Odometry,
    ParameterError,
    RangeReading,
    Ranges,
    RssiReading,
    WheelTicks,
    WifiScan,
)
from fusion.arrays import Floats
from fusion.odometry import wheel_increment
from fusion.robot import WHEELS
from fusion.timeline import order as place
from fusion.values import NANOSECONDS
from logs.prior import begin_ns
from logs.run import Run


class RunColumns:
    """The columns of one run. ``messages`` (n,) and ``readings`` (m,) are its rows; the other columns hold what faults
    may change: ``stamp_ns``, ``from_ns`` (of increments), ``arrival_ns``, ``rate_rad_s`` (of gyros) and ``roll`` (n,
    wheels), the share of a wheel's true roll that is measured, belong to messages; ``value`` [dBm or m] to readings.
    """

    def __init__(self, run: Run) -> None:
        measured = run.measurements
        self.run = run
        self.prior = run.prior
        self.start_ns = begin_ns(run.measurements)
        self.stamp_ns = np.array([message.time_ns for message in measured], dtype=np.int64)
        self.from_ns = np.array([m.from_ns if isinstance(m, Odometry) else m.time_ns for m in measured], dtype=np.int64)
        # A log keeps the order of arrival, not its times: a message was there once the newest before it was.
        self.arrival_ns = np.maximum.accumulate(self.stamp_ns)
        self.rate_rad_s = np.array([m.rate_rad_s if isinstance(m, Gyro) else 0.0 for m in measured], dtype=np.float64)
        self.roll = np.ones((len(measured), len(WHEELS[run.world.robot.drive]) or 2))
        self.messages = self._rows(
            [TOPICS[type(m)] for m in measured], [m.sensor for m in measured], np.arange(len(measured))
        )
        radio = [
            (i, m, reading)
            for i, m in enumerate(measured)
            if isinstance(m, WifiScan | Ranges)
            for reading in m.readings
        ]
        self.owner = np.array([i for i, _, _ in radio], dtype=np.int64)
        self.value = np.array([reading.value for _, _, reading in radio], dtype=np.float64)
        self.recorded_value = self.value.copy()
        self.readings = self._rows([TOPICS[type(m)] for _, m, _ in radio], [r.anchor for _, _, r in radio], self.owner)

    def rows(self, topic: str, source: str) -> RowSelection:
        """The rows that hold ``source``: readings for an anchor, else messages; raises `ParameterError` for neither."""
        anchors, sensors = self.readings.sources(topic), self.messages.sources(topic)
        if source and sensors and source not in anchors + sensors:
            raise ParameterError(f"the run has no {source!r} on {topic}; {it_has(source, anchors + sensors)}")
        return self.readings if source in anchors else self.messages

    def _rows(self, topics: Sequence[str], sources: Sequence[str], messages: NDArray[np.int64]) -> RowSelection:
        elapsed_s = (self.stamp_ns[messages] - self.start_ns) / NANOSECONDS
        kept = np.ones(len(topics), dtype=bool)
        return RowSelection(np.array(topics, dtype=str), np.array(sources, dtype=str), elapsed_s, kept)

    def as_run(self) -> Run:
        """The run as the columns hold it now, in the order of arrival. What was not changed is the same to the bit.

        Raises `MeasurementError` where wheels slipped that the world does not have.
        """
        counts = self._counts()
        order = (int(i) for i in np.argsort(self.arrival_ns, kind="stable") if self.messages.kept[i])
        made = {i: self._stamped(i, self._message(i, counts)) for i in order}
        measurements = {i: message for i, message in made.items() if message}
        stamps = {place(message): self._true_stamp_ns(i) for i, message in measurements.items()}
        wrong = {key: time_ns for key, time_ns in stamps.items() if key[0] != time_ns}
        return replace(self.run, prior=self.prior, measurements=tuple(measurements.values()), true_stamps=wrong)

    def _true_stamp_ns(self, i: int) -> int:
        message = self.run.measurements[i]
        return self.run.true_stamps.get(place(message), message.time_ns)

    def _message(self, i: int, counts: Mapping[int, tuple[int, ...]]) -> Measurement | None:
        """Message ``i`` with its present values; None for a scan whose readings are all lost."""
        message = self.run.measurements[i]
        if isinstance(message, WifiScan | Ranges):
            return self._scan(i, message)
        if isinstance(message, WheelTicks):
            return replace(message, counts=counts[i]) if i in counts else message
        if isinstance(message, Odometry):
            return self._increment(message, self.roll[i])
        if isinstance(message, Gyro) and message.rate_rad_s != self.rate_rad_s[i]:
            return replace(message, rate_rad_s=float(self.rate_rad_s[i]))
        return message

    def _stamped(self, i: int, message: Measurement | None) -> Measurement | None:
        time_ns = int(self.stamp_ns[i])
        if message is None or message.time_ns == time_ns:
            return message
        if isinstance(message, Odometry):
            return replace(message, time_ns=time_ns, from_ns=int(self.from_ns[i]))
        return replace(message, time_ns=time_ns)

    def _scan(self, i: int, scan: WifiScan | Ranges) -> WifiScan | Ranges | None:
        recorded: tuple[RssiReading | RangeReading, ...] = scan.readings
        rows = enumerate(recorded, int(np.searchsorted(self.owner, i)))
        readings = [_with_value(reading, float(self.value[row])) for row, reading in rows if self.readings.kept[row]]
        if recorded and not readings:
            return None
        return replace(scan, readings=tuple(readings))  # type: ignore[arg-type]  # of the kind they came from

    def _counts(self) -> dict[int, tuple[int, ...]]:
        """Cumulative counts of the encoders by message, once some of the roll is not measured: whole ticks; a fraction
        that is left over goes to the next message.
        """
        ticks = {i: m for i, m in enumerate(self.run.measurements) if isinstance(m, WheelTicks)}
        if not ticks or (self.roll[list(ticks)] == 1.0).all():
            return {}
        counts_by_message: dict[int, tuple[int, ...]] = {}
        for sensor in sorted({message.sensor for message in ticks.values()}):
            own = sorted((i for i, m in ticks.items() if m.sensor == sensor), key=lambda i: ticks[i].time_ns)
            counted = [ticks[i].counts for i in own]
            if {len(counts) for counts in counted} != {self.roll.shape[1]}:
                raise MeasurementError(
                    f"{sensor!r} does not count {self.roll.shape[1]} wheels, as the world's "
                    f"{self.run.world.robot.drive} drive has; correct robot.drive"
                )
            steps = np.diff(np.array(counted), axis=0) * self.roll[own[1:]]
            summed = np.rint(np.cumsum(np.vstack([counted[0], steps]), axis=0)).astype(np.int64)
            counts_by_message |= {i: tuple(map(int, row)) for i, row in zip(own, summed, strict=True)}
        return counts_by_message

    def _increment(self, odometry: Odometry, roll: Floats) -> Odometry:
        if (roll == 1.0).all():
            return odometry
        sideways = 0.5 * self.run.world.robot.track_width_m * odometry.turn_rad
        rolled = np.tile([odometry.distance_m - sideways, odometry.distance_m + sideways], len(roll) // 2) * roll
        distance_m, turn_rad = wheel_increment(self.run.world.robot, rolled.tolist())
        return replace(odometry, distance_m=distance_m, turn_rad=turn_rad)


def _with_value(reading: RssiReading | RangeReading, value: float) -> RssiReading | RangeReading:
    if value == reading.value or math.isnan(value):
        return reading
    if isinstance(reading, RssiReading):
        return reading._replace(rssi_dbm=value)
    return reading._replace(range_m=value)
