"""Wi-Fi signal strengths by scanning chosen channels, or by listening to the scans of other programs.

The work is done by `sensors.wifi.scanner`; `sensors.wifi.report` makes the outputs of a scan.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType

from fusion.driver import Clock, DriverOutput, DriverSpec, FakeDevice, Found, Needs
from fusion.errors import SettingError
from fusion.values import WifiScan, nanoseconds
from sensors.wifi.discovery import discover
from sensors.wifi.driver import WifiDriver
from sensors.wifi.errors import require_pyroute2
from sensors.wifi.interface import Interface, power_save
from sensors.wifi.nl80211 import Nl80211, Transport
from sensors.wifi.report import Report
from sensors.wifi.scanner import Plan, Scan, Scanner
from sensors.wifi.settings import USUAL_MHZ, WifiSettings, read_wifi_settings

SHORTEST_S = 0.4
"""Three channels, passively, on simulated radios; no round is expected to be shorter."""
LEAST_HZ = 0.2
"""A round may take up to twelve seconds before it is given up, and that is reported: silence must be longer."""


class Wifi(WifiDriver[Scan]):
    """One Wi-Fi interface that scans or listens; `sensors.wifi.nl80211_fake` is one without hardware."""

    summary = "Wi-Fi signal strengths of chosen access points, by nl80211"
    groups = ("scan",)

    def __init__(
        self,
        name: str,
        clock: Clock,
        *,
        interface: str = "wlan0",
        frequencies_mhz: Sequence[int] = USUAL_MHZ,
        names: Mapping[str, str] = MappingProxyType({}),
        only_named: bool = False,
        mode: str = "passive",
        per_channel: bool = False,
        or_listen: bool = False,
        period_s: float = 1.0,
        stamp: str = "auto",
        device: Transport | None = None,
    ) -> None:
        """`sensors.wifi.settings` describes each; ``device`` stands in for the kernel."""
        given = {"interface": interface, "frequencies_mhz": frequencies_mhz, "names": names, "only_named": only_named}
        given |= {"mode": mode, "per_channel": per_channel, "or_listen": or_listen, "period_s": period_s}
        self._settings = read_wifi_settings(name, given | {"stamp": stamp})
        super().__init__(name, clock, interface, device)
        self._report = Report(name, self._settings)
        self._scanner: Scanner | None = None

    @property
    def spec(self) -> DriverSpec:
        """Expected rate of scans; those of other programs have none."""
        settings = self._settings
        if self._listens():
            return DriverSpec((WifiScan,), 0.0, 0.0, Needs(modules=("pyroute2",)))
        nominal_hz = 1.0 / max(settings.period_s, SHORTEST_S)
        needs = Needs(capabilities=("CAP_NET_ADMIN",), modules=("pyroute2",))
        return DriverSpec((WifiScan,), nominal_hz, min(LEAST_HZ, nominal_hz / 2.0), needs)

    @classmethod
    def discover(cls) -> list[Found]:
        """Every Wi-Fi interface, and whether this user may scan on it or only listen."""
        return discover(cls.summary)

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeDevice]:
        """Three access points on a virtual clock."""
        require_pyroute2()
        from sensors.wifi.nl80211_fake import FakeWifi

        yield FakeWifi()

    def _listens(self) -> bool:
        return self._settings.mode == "listen" if self._scanner is None else self._scanner.listens

    def _made(self, nl80211: Nl80211, interface: Interface) -> Scanner:
        if self._settings.mode != "listen":
            _require_channels(interface, self._settings.frequencies_mhz)
        self._report.begin(interface.driver)
        self._scanner = Scanner(self._clock, _plan(self._settings), nl80211, interface)
        return self._scanner

    def _settings_of(self, nl80211: Nl80211, interface: Interface) -> Mapping[str, object]:
        return {
            "interface": interface.name,
            "mode": "listen" if self._listens() else self._settings.mode,
            "per_channel": self._settings.per_channel,
            "frequencies_mhz": tuple(self._settings.frequencies_mhz),
            "stamp": self._report.stamp.value,
            "power_save": power_save(nl80211, interface),
        }

    def _outputs(self, result: Scan) -> list[DriverOutput]:
        return self._report.outputs(result, listens=self._listens())


def _plan(settings: WifiSettings) -> Plan:
    channels = tuple(settings.frequencies_mhz)
    groups = tuple((channel,) for channel in channels) if settings.per_channel else (channels,)
    is_active, listens = settings.mode == "active", settings.mode == "listen"
    return Plan(groups or ((),), is_active, listens, settings.or_listen, nanoseconds(settings.period_s))


def _require_channels(interface: Interface, wanted: Sequence[int]) -> None:
    """Refuse channels that the radio does not have by name, which the kernel would not."""
    offered = interface.frequencies_mhz
    for channel in wanted:
        if offered and channel not in offered:
            near = min(offered, key=lambda other: abs(other - channel))
            raise SettingError(f"{interface.name} has no channel at {channel} MHz", f"the nearest is {near} MHz")
