"""Drivers of UWB modules over real USB, kept by their keeper while the cable is pulled out and put in again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fusion import BootClock, Diagnostic, DriverOutput, NotFoundError, Ranges
from kernel.guest.serial import NEAR, Module, UsbSerial
from sensors.onboard.driver_lifecycle import Keeper
from sensors.uwb.dwm1001 import FakeShell, UwbDwm1001
from sensors.uwb.fake_serial import Mute, Talker
from sensors.uwb.lines import UwbLines
from sensors.uwb.serial_ranging import SerialRanging

ENOUGH = 5
"""Ranges before and after."""


class Chatter(Mute):
    """A firmware that only reports."""

    reports = True


def run(line: str, dwm1001: str) -> dict[str, Any]:
    """What is heard of a module that says `line`, and of a DWM1001 whose shell says `dwm1001`."""
    usb, clock = UsbSerial(), BootClock()
    return {
        "lines": story(usb, UwbLines("uwb", clock, port=str(NEAR)), Chatter, line),
        "dwm1001": story(usb, UwbDwm1001("uwb", clock, port=str(NEAR)), FakeShell, dwm1001),
    }


def story(usb: UsbSerial, driver: SerialRanging, firmware: Callable[[], Talker], line: str) -> dict[str, Any]:
    """Ranges, the cable pulled out until a try to open the port has failed, ranges again."""
    keeper = Keeper("uwb", driver, BootClock())
    usb.plug()
    with Module(firmware(), line):
        said = turn_until(keeper, lambda said: len(ranges(said)) == ENOUGH)
    usb.unplug()
    said += turn_until(keeper, lambda _: isinstance(keeper.error, NotFoundError))
    usb.plug()
    with Module(firmware(), line):
        said += turn_until(keeper, lambda said: len(ranges(said)) == ENOUGH)
        found = [found.id for found in driver.discover()]
        keeper.close()
    usb.unplug()
    diagnostics = [
        [one.level.name, one.text] for one in said if isinstance(one, Diagnostic) and dict(one.values).get("state")
    ]
    return {"ranges": ranges(said), "diagnostics": diagnostics, "losses": keeper.losses, "found": found}


def turn_until(keeper: Keeper, holds: Callable[[list[DriverOutput]], bool]) -> list[DriverOutput]:
    """What the keeper hears until `holds` is true of it."""
    said: list[DriverOutput] = []
    while not holds(said):
        said += [received.said for received in keeper.turn(0.1)]
    return said


def ranges(said: list[DriverOutput]) -> list[list[tuple[str, float]]]:
    """Anchor and metres of each message."""
    return [[(reading.anchor, reading.range_m) for reading in one.readings] for one in said if isinstance(one, Ranges)]
