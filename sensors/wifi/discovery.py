"""Which Wi-Fi interfaces there are, and what this user may do with them; never an error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from fusion.driver import Found
from fusion.errors import DriverError
from sensors.wifi.errors import require_pyroute2

if TYPE_CHECKING:
    from sensors.wifi.nl80211 import Nl80211, Transport

CAP_NET_ADMIN = 12


def may_scan(status: Path = Path("/proc/self/status")) -> bool:
    """Whether this process has CAP_NET_ADMIN."""
    lines = status.read_text().splitlines() if status.exists() else []
    effective = next((line.split()[1] for line in lines if line.startswith("CapEff:")), "0")
    return bool(int(effective, 16) >> CAP_NET_ADMIN & 1)


def discover(about: str, transport: Transport | None = None) -> list[Found]:
    """Every interface, with the settings that open it for `wifi`."""
    may = may_scan()
    rights = "scanning permitted" if may else 'only mode = "listen" is permitted: CAP_NET_ADMIN is missing'
    mode = {} if may else {"mode": "listen"}
    found = []
    try:
        with _asked(transport) as nl80211:
            from sensors.wifi.interface import interfaces

            for one in interfaces(nl80211):
                words = (about, one.driver, f"phy{one.wiphy}", one.mac, one.state, rights)
                settings = MappingProxyType({"interface": one.name, **mode})
                found.append(Found(f"wifi:{one.mac}", ", ".join(filter(None, words)), settings))
    except (OSError, DriverError):
        return []
    return found


def discover_ranging(about: str, transport: Transport | None = None) -> list[Found]:
    """Every interface whose radio measures ranges."""
    found = []
    try:
        with _asked(transport) as nl80211:
            from sensors.wifi.interface import interfaces, with_radio

            for one in interfaces(nl80211):
                if with_radio(nl80211, one).ftm is not None:
                    words = (about, one.driver, f"phy{one.wiphy}", one.mac, one.state)
                    settings = MappingProxyType({"interface": one.name})
                    found.append(Found(f"wifi_rtt:{one.mac}", ", ".join(filter(None, words)), settings))
    except (OSError, DriverError):
        return []
    return found


@contextmanager
def _asked(transport: Transport | None) -> Iterator[Nl80211]:
    require_pyroute2()
    from sensors.wifi.nl80211 import KernelTransport, Nl80211

    nl80211 = Nl80211(transport or KernelTransport())
    nl80211.open()
    try:
        yield nl80211
    finally:
        nl80211.close()
