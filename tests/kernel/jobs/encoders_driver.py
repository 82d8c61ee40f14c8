"""The driver of wheel encoders on the kernel's own GPIO lines: counted, held up, shared, pulled out, back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fusion import BootClock, Diagnostic, DriverError, DriverOutput, WheelTicks
from kernel.guest.gpio import SimulatedGpio
from sensors.wheels.encoders import Encoders

NAMES = ["front left", "front right", "rear left", "rear right"]


def run(pulses: list[int], unread: int) -> dict[str, Any]:
    """`pulses` on each line, `unread` on line 0 while nobody reads; a second owner; the chip goes and comes."""
    chip = SimulatedGpio(NAMES)
    wheels, other = driver(chip.device), driver(chip.device)
    seen: dict[str, Any] = {"found": [found.settings["chip"] for found in Encoders.discover()]}
    seen["opened"] = dict(wheels.open().settings)
    seen["at rest"] = report(wheels)
    turn(chip, pulses)
    seen["turned"] = report(wheels)
    chip.pulse(0, unread)
    seen["held up"] = report(wheels)
    seen["second owner"] = refusal(other)
    seen["line that is not there"] = refusal(driver(chip.device, [0, 9]))
    seen["chip that is not there"] = refusal(driver(Path("/dev/gpiochip9")))
    chip.unplug()
    seen["unplugged"] = loss(wheels)
    seen["while unplugged"] = refusal(wheels)
    chip.plug()
    wheels.open()
    turn(chip, pulses)
    seen["plugged again"] = report(wheels)
    wheels.close()
    seen["after the first owner"] = refusal(other)
    return seen


def driver(device: Path, lines: Sequence[int] = range(len(NAMES))) -> Encoders:
    """Encoders that are not debounced: a test's edges follow each other in no time."""
    return Encoders("encoders", BootClock(), chip=str(device), lines=lines, debounce_s=0.0)


def turn(chip: SimulatedGpio, pulses: list[int]) -> None:
    """So many edges on each line."""
    for line, times in enumerate(pulses):
        chip.pulse(line, times)


def report(wheels: Encoders) -> dict[str, Any]:
    """Counts of the next report but one, for which all edges until now were read, and the diagnostics until then."""
    said: list[DriverOutput] = []
    while sum(isinstance(one, WheelTicks) for one in said) < 2:
        said += wheels.poll(1.0)
    diagnostics = [{"text": one.text, **dict(one.values)} for one in said if isinstance(one, Diagnostic)]
    return {"counts": [one.counts for one in said if isinstance(one, WheelTicks)][-1], "diagnostics": diagnostics}


def loss(wheels: Encoders) -> list[str]:
    """The kind and the words of the error that ends reading."""
    try:
        while True:
            wheels.poll(1.0)
    except DriverError as error:
        return [type(error).__name__, str(error)]


def refusal(wheels: Encoders) -> list[str]:
    """The kind and the words of the error of opening; nothing where it opens."""
    try:
        wheels.open()
    except DriverError as error:
        return [type(error).__name__, str(error)]
    return []
