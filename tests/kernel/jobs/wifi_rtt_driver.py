"""The driver `wifi_rtt` on simulated radios: true distances, a peer that falls silent, a radio that cannot."""

from __future__ import annotations

from typing import Any

from fusion.driver import BootClock, Diagnostic
from fusion.errors import DriverError
from fusion.values import Ranges
from kernel.guest.medium import NAME, NEW_RADIO, address
from kernel.guest.netlink import Family, attribute
from kernel.guest.radios import FREQUENCIES_MHZ, air_with_radios
from kernel.guest.system import set_link
from kernel.guest.world import Air, Point
from sensors.wifi.rtt import WifiRtt

POLL_S = 0.2
POLLS = 300


def run(path: list[Point]) -> dict[str, Any]:
    """A round at each place of `path` [m]; then one with access point 3 silent; then what a plain radio says."""
    air = Air()
    with air_with_radios(air):
        down = refusal(rtt())
        set_link("wlan0", "up")
        seen: dict[str, Any] = {"down": down, "rounds": []}
        for place in path:
            air.robot = place
            seen["rounds"].append(one_round())
        air.silent = frozenset({3})
        seen["ap3 silent"] = one_round()
        seen["found"] = [one.id for one in WifiRtt.discover()]
        with Family("MAC80211_HWSIM") as hwsim:
            hwsim.command(NEW_RADIO, attribute(NAME, b"plain\0"))
        seen["plain radio"] = refusal(rtt(interface="wlan4"))
        return seen


def rtt(**settings: Any) -> WifiRtt:
    """The driver with every access point as a peer."""
    peers = [
        {"bssid": address(number).hex(":"), "frequency_mhz": mhz, "name": f"ap{number}"}
        for number, mhz in enumerate(FREQUENCIES_MHZ, 1)
    ]
    return WifiRtt("rtt", BootClock(), peers=peers, period_s=0.0, **settings)


def one_round() -> dict[str, Any]:
    """What a driver says first."""
    driver = rtt()
    driver.open()
    for _ in range(POLLS):
        if said := driver.poll(POLL_S):
            break
    driver.close()
    ranges = [list(one) for batch in said if isinstance(batch, Ranges) for one in batch.readings]
    diagnostics = [[one.level.name, one.text, *map(list, one.values)] for one in said if isinstance(one, Diagnostic)]
    return {"ranges": ranges, "diagnostics": diagnostics}


def refusal(driver: WifiRtt) -> list[str] | None:
    """The error of opening."""
    try:
        driver.open()
    except DriverError as error:
        return [type(error).__name__, error.what, error.hint]
    finally:
        driver.close()
    return None
