"""Outputs of a scan: a `WifiScan`, and a diagnostic about its circumstances.

The diagnostic has what the measurement has no room for: the scan's number, mode and channels, its window, how it was
stamped and how well, and the networks' names.
"""

from __future__ import annotations

from collections.abc import Sequence

from fusion.driver import Diagnostic, DriverOutput, Level
from fusion.values import RssiReading, WifiScan, seconds
from sensors.wifi.reading import Stamp, Stamped, betrays_end_stamping, stamped
from sensors.wifi.scanner import Scan
from sensors.wifi.settings import WifiSettings

END_STAMPING = frozenset({"brcmfmac"})
"""Kernel drivers that are known, from their source, to stamp at the end of a scan."""


class Report:
    """Numbers the scans of one sensor, and remembers the stamping of its device."""

    def __init__(self, name: str, settings: WifiSettings) -> None:
        self._name, self._settings = name, settings
        self._scans = self._seq = 0
        self.begin("")

    def begin(self, driver: str) -> None:
        """A device was opened; ``driver`` is the kernel's name for its driver."""
        at_end = driver in END_STAMPING if self._settings.stamp == "auto" else self._settings.stamp == "scan_end"
        self.stamp = Stamp.SCAN_END if at_end else Stamp.FRAME

    def outputs(self, scan: Scan, *, listens: bool) -> list[DriverOutput]:
        """A measurement if anything was received, and always the diagnostic."""
        if self._settings.stamp == "auto" and any(map(betrays_end_stamping, scan.parts)):
            self.stamp = Stamp.SCAN_END  # caught once, it always does
        readings = self._kept([one for part in scan.parts for one in stamped(part, self.stamp)])
        diagnostic = self._diagnostic(scan, readings, "listen" if listens else self._settings.mode)
        self._scans += 1
        return [*self._measurement(readings), diagnostic]

    def _kept(self, readings: Sequence[Stamped]) -> list[Stamped]:
        """Newest last."""
        names, only_named = self._settings.names, self._settings.only_named
        kept = (one for one in readings if not only_named or one.entry.bssid in names)
        return sorted(kept, key=lambda one: (one.time_ns, one.entry.bssid))

    def _measurement(self, readings: Sequence[Stamped]) -> list[WifiScan]:
        if not readings:
            return []
        newest_ns = readings[-1].time_ns
        received = (RssiReading(self._anchor(one), one.entry.rssi_dbm, newest_ns - one.time_ns) for one in readings)
        measured = WifiScan(newest_ns, self._name, self._seq, tuple(received))
        self._seq += 1
        return [measured]

    def _anchor(self, reading: Stamped) -> str:
        return self._settings.names.get(reading.entry.bssid, reading.entry.bssid)

    def _diagnostic(self, scan: Scan, readings: Sequence[Stamped], mode: str) -> Diagnostic:
        windows = [part.window for part in scan.parts]
        networks = (f"{self._anchor(one)}={one.entry.ssid}@{one.entry.frequency_mhz}" for one in readings)
        values: dict[str, object] = {
            "scan": self._scans,
            "mode": mode if scan.is_ours or mode == "listen" else "borrowed",
            "parts": len(windows),
            "frequencies_mhz": " ".join(map(str, self._settings.frequencies_mhz)) if scan.is_ours else "",
            "trigger_ns": windows[0].began_ns,
            "done_ns": windows[-1].done_ns,
            "stamp": self.stamp.value,
            "stamp_std_s": f"{seconds(max((one.std_ns for one in readings), default=0)):.4f}",
            "stale": sum(part.refused for part in scan.parts),
            "heard": " ".join(networks),
        }
        about = tuple((key, str(value)) for key, value in values.items())
        return Diagnostic(windows[-1].done_ns, self._name, Level.OK, f"heard {len(readings)} access points", about)
