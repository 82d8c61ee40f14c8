"""Faults of a simulated sensor, by name, on the side of the device, with which a driver has to cope.

`benchmarks.faults` damages a run that is already recorded, the same for all estimators; these happen while it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fusion.errors import SettingError, WorldError, did_you_mean
from fusion.schema import read_record
from fusion.values import Measurement, RssiReading, Truth, WheelTicks, WifiScan, nanoseconds, seconds

KINDS = {
    "drop_out": "nothing is sent",
    "unplug": "the device is gone",
    "clock_jump": "stamps are off by ``amount`` s",
    "tick_loss": "the encoders miss ``amount`` of the ticks, as a share",
    "slip": "the wheels roll ``amount`` further than the robot goes, as a share",
    "stale_anchor": "``anchor`` was switched off, and is listed on with its last reading, ever older",
}
"""Effect of each kind between ``from_s`` and ``to_s``."""
NEEDED = {"clock_jump": "amount", "tick_loss": "amount", "slip": "amount", "stale_anchor": "anchor"}


@dataclass(frozen=True)
class Window:
    """One entry of ``faults``: times in seconds from the robot's start."""

    kind: str
    from_s: float = 0.0
    to_s: float | None = None
    amount: float = 0.0
    anchor: str = ""


class SensorFault:
    """One fault of one sensor, with its memory of the past."""

    def __init__(self, window: Window) -> None:
        self._window = window
        self._off: tuple[float, ...] = ()
        """Error of each wheel's count until now, in ticks."""
        self._counts: tuple[int, ...] | None = None
        self._last: tuple[int, RssiReading] | None = None

    def _lasts(self, elapsed_ns: int) -> bool:
        to_s = math.inf if self._window.to_s is None else self._window.to_s
        return self._window.from_s <= seconds(elapsed_ns) < to_s

    def unplugs(self, elapsed_ns: int) -> bool:
        """Whether the device is gone so long after the start."""
        return self._window.kind == "unplug" and self._lasts(elapsed_ns)

    def apply(self, message: Measurement | Truth) -> Measurement | Truth | None:
        """The message, stamped with the time since the start, as the fault leaves it; None: it is lost."""
        kind, lasts = self._window.kind, self._lasts(message.time_ns)
        if kind in ("tick_loss", "slip") and isinstance(message, WheelTicks):
            return self._miscounted(message, self._window.amount * (-1.0 if kind == "tick_loss" else 1.0) * lasts)
        if kind == "stale_anchor" and isinstance(message, WifiScan):
            return self._stale(message) if lasts else self._remembered(message)
        if kind == "drop_out" and lasts:
            return None
        if kind == "clock_jump" and lasts:
            jumped_ns = message.time_ns + nanoseconds(self._window.amount)
            if isinstance(message, Truth):
                return message._replace(time_ns=jumped_ns)
            return replace(message, time_ns=jumped_ns)
        return message

    def _miscounted(self, message: WheelTicks, share: float) -> WheelTicks:
        """Counts stay cumulative: what was lost, or rolled too much, stays so."""
        before = message.counts if self._counts is None else self._counts
        off = self._off or (0.0,) * len(message.counts)
        steps = zip(off, message.counts, before, strict=True)
        self._off = tuple(miscounted + share * (count - last) for miscounted, count, last in steps)
        self._counts = message.counts
        return replace(message, counts=tuple(c + round(o) for c, o in zip(message.counts, self._off, strict=True)))

    def _remembered(self, scan: WifiScan) -> WifiScan:
        for reading in scan.readings:
            if reading.anchor == self._window.anchor:
                self._last = scan.time_ns - reading.age_ns, reading
        return scan

    def _stale(self, scan: WifiScan) -> WifiScan:
        others = tuple(reading for reading in scan.readings if reading.anchor != self._window.anchor)
        if self._last is None:
            return replace(scan, readings=others)
        received_ns, reading = self._last
        return replace(scan, readings=(*others, reading._replace(age_ns=scan.time_ns - received_ns)))


def read_faults(tables: Sequence[Mapping[str, object]], name: str) -> list[SensorFault]:
    """The faults of sensor ``name`` from its settings; raises `SettingError`."""
    found = []
    for i, table in enumerate(tables):
        where = f"{name}: faults[{i}]"
        try:
            window = read_record(Window, table, where)
        except WorldError as error:
            raise SettingError(str(error), "see `sensors.simulation.sensor_fault`") from error
        if window.kind not in KINDS:
            raise SettingError(f"{where}: no fault {window.kind!r}", did_you_mean(window.kind, KINDS))
        needed = NEEDED.get(window.kind)
        if needed and not getattr(window, needed):
            raise SettingError(f"{where}: {window.kind} needs {needed}", f"its effect: {KINDS[window.kind]}")
        found.append(SensorFault(window))
    return found
