"""Three access points, a robot that moves, and the RSSI of each scan; then the medium stops."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from kernel.guest.nl80211 import Reading, Scanner
from kernel.guest.radios import FREQUENCIES_MHZ, access_points, air_with_radios
from kernel.guest.system import set_link
from kernel.guest.world import Air, Point


@dataclass
class Seen:
    """The readings of each scan, and of one after the medium has stopped."""

    scans: list[list[Reading]] = field(default_factory=list)
    without_medium: list[Reading] = field(default_factory=list)


def run(path: list[Point]) -> dict[str, Any]:
    """One scan at each place of `path` [m]."""
    air, seen = Air(), Seen()
    with air_with_radios(air) as medium, access_points(air):
        set_link("wlan0", "up")
        scanner = Scanner("wlan0")
        for place in path:
            air.robot = place
            seen.scans.append(scanner.scan(FREQUENCIES_MHZ))
        medium.close()
        seen.without_medium = scanner.scan(FREQUENCIES_MHZ)
    return asdict(seen)
