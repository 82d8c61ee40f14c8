"""The Wi-Fi interfaces of this machine and their own descriptions; needs no rights."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from fusion.errors import NotFoundError, did_you_mean
from sensors.wifi.nl80211 import Nl80211
from sensors.wifi.nl80211_message import Attributes, Command

NETWORK = Path("/sys/class/net")
POWER_SAVE = {0: "off", 1: "on"}


class Interface(NamedTuple):
    """One interface. ``ftm`` is what its radio offers for ranging, None where it cannot."""

    name: str
    number: int
    wiphy: int
    mac: str
    frequencies_mhz: tuple[int, ...] = ()
    ftm: Attributes | None = None

    @property
    def driver(self) -> str:
        """The kernel driver's name, "" where there is none to see."""
        link = NETWORK / self.name / "device" / "driver"
        return link.resolve().name if link.exists() else ""

    @property
    def state(self) -> str:
        """Whether it is up or down, in the kernel's words; empty where it has none."""
        with suppress(OSError):
            return (NETWORK / self.name / "operstate").read_text().strip()
        return ""


def interfaces(nl80211: Nl80211) -> list[Interface]:
    """All of them, by name; raises `OSError`."""
    found = [message.attributes for message in nl80211.ask(Command.GET_INTERFACE, {}, dump=True)]
    return sorted(
        Interface(one["IFNAME"], one["IFINDEX"], one.get("WIPHY", 0), one.get("MAC", b"").hex(":"))
        for one in found
        if "IFNAME" in one and "IFINDEX" in one  # a P2P device has no network interface
    )


def look_up(nl80211: Nl80211, name: str) -> Interface:
    """The interface with its radio's channels and abilities; raises `NotFoundError`, `OSError`."""
    there = {one.name: one for one in interfaces(nl80211)}
    if name not in there:
        raise NotFoundError(f"there is no Wi-Fi interface {name!r}", f"plug it in, or: {did_you_mean(name, there)}")
    return with_radio(nl80211, there[name])


def with_radio(nl80211: Nl80211, interface: Interface) -> Interface:
    """The interface with what its radio offers; a radio's description comes in many parts."""
    asked: Attributes = {"WIPHY": interface.wiphy, "SPLIT_WIPHY_DUMP": True}
    parts = [message.attributes for message in nl80211.ask(Command.GET_WIPHY, asked, dump=True)]
    offered = {
        channel["FREQ"]
        for part in parts
        for band in part.get("WIPHY_BANDS", ())
        for channel in band.get("FREQS", ())
        if not channel.get("DISABLED")
    }
    ftm = [part["PEER_MEASUREMENTS"].get("TYPE_CAPA", {}).get("FTM") for part in parts if "PEER_MEASUREMENTS" in part]
    return interface._replace(frequencies_mhz=tuple(sorted(offered)), ftm=next(iter(ftm), None))


def power_save(nl80211: Nl80211, interface: Interface) -> str:
    """Whether the radio sleeps between beacons: on, off, or unknown where the driver does not report it."""
    with suppress(OSError):
        (answer,) = nl80211.ask(Command.GET_POWER_SAVE, {"IFINDEX": interface.number})
        return POWER_SAVE.get(answer.attributes.get("PS_STATE", -1), "unknown")
    return "unknown"


def require_there(nl80211: Nl80211, interface: Interface) -> None:
    """Raises `OSError`, ENODEV, where it is gone."""
    nl80211.ask(Command.GET_INTERFACE, {"IFINDEX": interface.number})
