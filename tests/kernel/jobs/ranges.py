"""Time-of-flight ranges (FTM) to three access points, before and after one falls silent."""

from __future__ import annotations

from typing import Any

from kernel.guest.ftm import measure
from kernel.guest.medium import address
from kernel.guest.radios import FREQUENCIES_MHZ, air_with_radios
from kernel.guest.system import set_link
from kernel.guest.world import Air


def run(robot: tuple[float, float]) -> dict[str, Any]:
    """Ranges from `robot` [m]."""
    air = Air(robot=robot)
    peers = {address(k): mhz for k, mhz in enumerate(FREQUENCIES_MHZ, 1)}
    with air_with_radios(air):
        set_link("wlan0", "up")
        all_there = measure("wlan0", peers)
        air.silent = frozenset({3})
        return {"all there": all_there, "ap3 silent": measure("wlan0", peers)}
