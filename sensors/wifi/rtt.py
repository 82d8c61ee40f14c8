"""Ranges by Wi-Fi round-trip time (FTM), where the radio and its driver offer it: nl80211's peer measurements.

Few radios initiate them, and a Raspberry Pi's does not; peers must respond. Every attempt is reported with its status.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from fusion.driver import Clock, Diagnostic, DriverOutput, DriverSpec, FakeDevice, Found, Level, Needs
from fusion.errors import SettingError, UnsupportedError
from fusion.values import RangeReading, Ranges
from sensors.wifi.discovery import discover_ranging
from sensors.wifi.driver import WifiDriver
from sensors.wifi.errors import require_pyroute2
from sensors.wifi.ftm import Attempt, Status
from sensors.wifi.interface import Interface
from sensors.wifi.nl80211 import Nl80211, Transport
from sensors.wifi.ranger import Ranger, Round
from sensors.wifi.settings import read_rtt_settings

SHORTEST_S = 0.1
LEAST_HZ = 0.2
"""As for scans: silence must last longer than a round that is given up."""


class WifiRtt(WifiDriver[Round]):
    """One Wi-Fi interface that asks its peers in rounds."""

    summary = "Wi-Fi round-trip-time ranges (FTM) to chosen access points, by nl80211"

    def __init__(
        self,
        name: str,
        clock: Clock,
        *,
        peers: Sequence[Mapping[str, object]],
        interface: str = "wlan0",
        period_s: float = 1.0,
        device: Transport | None = None,
    ) -> None:
        """`sensors.wifi.settings.Peer` describes the keys of ``peers``; ``device`` stands in for the kernel."""
        self._settings = read_rtt_settings(name, {"peers": peers, "interface": interface, "period_s": period_s})
        super().__init__(name, clock, interface, device)
        self._anchors = {peer.bssid: peer.anchor for peer in self._settings.peers}
        self._rounds = self._seq = 0
        nominal_hz = 1.0 / max(self._settings.period_s, SHORTEST_S)
        needs = Needs(capabilities=("CAP_NET_ADMIN",), modules=("pyroute2",))
        self.spec = DriverSpec((Ranges,), nominal_hz, min(LEAST_HZ, nominal_hz / 2.0), needs)

    @classmethod
    def discover(cls) -> list[Found]:
        """Every Wi-Fi interface whose radio measures ranges."""
        return discover_ranging(cls.summary)

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeDevice]:
        """Three access points that respond, on a virtual clock."""
        require_pyroute2()
        from sensors.wifi.nl80211_fake import FakeWifi, three_access_points

        peers = [{"bssid": bssid, "frequency_mhz": ap.frequency_mhz} for bssid, ap in three_access_points().items()]
        yield FakeWifi({"peers": peers})

    def _made(self, nl80211: Nl80211, interface: Interface) -> Ranger:
        if interface.ftm is None:
            raise UnsupportedError(
                f"the radio of {interface.name} cannot measure ranges (no PMSR capability)",
                "use one that initiates FTM, as Intel 8260 to AX210",
            )
        most = interface.ftm.get("MAX_FTMS_PER_BURST", 0)
        for peer in self._settings.peers:
            if most and peer.frames_per_burst > most:
                raise SettingError(
                    f"{self._name}: {peer.frames_per_burst} frames per burst; {interface.name} has at most {most}",
                    f"give frames_per_burst = {most}",
                )
        return Ranger(self._clock, self._settings.peers, self._settings.period_s, nl80211, interface)

    def _settings_of(self, nl80211: Nl80211, interface: Interface) -> Mapping[str, object]:  # noqa: ARG002
        peers = {peer.anchor: f"{peer.bssid} {peer.frequency_mhz} MHz" for peer in self._settings.peers}
        return {"interface": interface.name, "peers": peers, "offers": dict(interface.ftm or {})}

    def _outputs(self, result: Round) -> list[DriverOutput]:
        """The ranges that were measured, and the status of each attempt."""
        attempts = [one for one in result.attempts if one.bssid in self._anchors]
        readings = [
            RangeReading(self._anchors[one.bssid], one.range_m, one.std_m)
            for one in attempts
            if one.status is Status.SUCCESS and one.range_m is not None
        ]
        self._rounds += 1
        diagnostic = self._diagnostic(attempts, len(readings), result.done_ns)
        if not readings:
            return [diagnostic]
        answered_ns = (one.time_ns for one in attempts if one.time_ns is not None and one.time_ns <= result.done_ns)
        time_ns, self._seq = max(answered_ns, default=result.done_ns), self._seq + 1
        return [Ranges(time_ns, self._name, self._seq - 1, tuple(readings)), diagnostic]

    def _diagnostic(self, attempts: list[Attempt], measured: int, done_ns: int) -> Diagnostic:
        values = [("round", str(self._rounds - 1)), *((self._anchors[one.bssid], _in_words(one)) for one in attempts)]
        level = Level.OK if measured == len(attempts) == len(self._anchors) else Level.WARN
        return Diagnostic(done_ns, self._name, level, f"{measured} of {len(self._anchors)} ranges", tuple(values))


def _in_words(attempt: Attempt) -> str:
    parts = [attempt.status.name.lower()]
    parts += [] if attempt.range_m is None else [f"{attempt.range_m:.3f} m"]
    parts += [] if attempt.std_m is None else [f"std {attempt.std_m:.3f} m"]
    parts += [] if attempt.rssi_dbm is None else [f"{attempt.rssi_dbm:.0f} dBm"]
    parts += [] if attempt.fail_reason is None else [f"reason {attempt.fail_reason}"]
    return ", ".join(parts)
