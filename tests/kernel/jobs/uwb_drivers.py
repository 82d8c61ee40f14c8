"""Drivers of UWB modules over real USB, run by their lifecycle while the cable is pulled out and put in again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fusion import BootClock, Diagnostic, DriverOutput, NotFoundError, Ranges
from kernel.guest.serial import NEAR, Module, UsbSerial
from sensors.onboard.driver_lifecycle import DriverLifecycle
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
    lifecycle = DriverLifecycle("uwb", driver, BootClock())
    usb.plug()
    with Module(firmware(), line):
        outputs = step_until(lifecycle, lambda outputs: len(ranges(outputs)) == ENOUGH)
    usb.unplug()
    outputs += step_until(lifecycle, lambda _: isinstance(lifecycle.error, NotFoundError))
    usb.plug()
    with Module(firmware(), line):
        outputs += step_until(lifecycle, lambda outputs: len(ranges(outputs)) == ENOUGH)
        found = [found.id for found in driver.discover()]
        lifecycle.close()
    usb.unplug()
    diagnostics = [
        [one.level.name, one.text] for one in outputs if isinstance(one, Diagnostic) and dict(one.values).get("state")
    ]
    return {"ranges": ranges(outputs), "diagnostics": diagnostics, "losses": lifecycle.losses, "found": found}


def step_until(lifecycle: DriverLifecycle, holds: Callable[[list[DriverOutput]], bool]) -> list[DriverOutput]:
    """Outputs of the driver until `holds` is true of them."""
    outputs: list[DriverOutput] = []
    while not holds(outputs):
        outputs += [received.output for received in lifecycle.step(0.1)]
    return outputs


def ranges(outputs: list[DriverOutput]) -> list[list[tuple[str, float]]]:
    """Anchor and metres of each message."""
    return [
        [(reading.anchor, reading.range_m) for reading in one.readings] for one in outputs if isinstance(one, Ranges)
    ]
