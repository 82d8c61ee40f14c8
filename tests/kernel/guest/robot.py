"""A robot made of the guest's devices: what its simulated sensors say becomes edges, registers, lines, radio waves."""

from __future__ import annotations

import json
import math
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import singledispatchmethod
from pathlib import Path

import numpy as np

from fusion import Gyro, MotorCommand, Pose, Ranges, Truth, WheelTicks
from kernel.guest.gpio import SimulatedGpio
from kernel.guest.gyro import StubMpu6050
from kernel.guest.serial import FAR, UsbSerial, raw
from kernel.guest.world import Air
from sensors.simulation.channel import Channel
from sensors.simulation.scenario import Scenario

WHEELS = ["front left", "front right", "rear left", "rear right"]
STEPS_PER_RAD_S = 131.0 * math.degrees(1.0)
"""Of an MPU-6050 at its full scale of 250 degrees a second, which is what our driver sets."""
LEVEL, TEMPERATURE = (0, 0, 16384), -1500
"""One g upwards; 32 degrees Celsius."""
MOTORS = Path("/run/motors")


class SimulatedAir(Air):
    """Air in which the robot hears each anchor of a scenario as the project's simulator has it: its own power, walls,
    shadowing that belongs to the place, and fading.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        anchors = scenario.world.anchors
        super().__init__(access_points=tuple((anchor.x, anchor.y) for anchor in anchors))
        streams = [np.random.default_rng([seed, number]) for number in range(len(anchors))]
        self._channels = [Channel(anchor, stream, scenario) for anchor, stream in zip(anchors, streams, strict=True)]
        self._fading = np.random.default_rng([seed, len(anchors)])
        self.pose = Pose(*self.robot, 0.0)

    def rssi_dbm(self, sender: int, receiver: int) -> int | None:
        """The robot hears the channels. Access points do not hear each other: that would cost frames for nothing."""
        if sender and receiver:
            return None
        rssi = round(self._channels[(sender or receiver) - 1].rssi_dbm(self.pose, self._fading))
        return rssi if rssi >= self.faintest_dbm else None


class Robot:
    """The devices, all there and at rest. `show` makes them say what a simulated sensor said.

    ``counts`` are the edges that each wheel has given.
    """

    def __init__(self, air: SimulatedAir) -> None:
        self._air = air
        self._gpio, self._chip, self.usb = SimulatedGpio(WHEELS), StubMpu6050(), UsbSerial()
        self.counts: tuple[int, ...] = (0,) * len(WHEELS)
        self._controller = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._far: int | None = None
        self._turn(0.0)
        self.usb.plug()

    @contextmanager
    def uwb(self) -> Iterator[None]:
        """The UWB module has power and speaks, for the length of a ``with`` block."""
        with raw(FAR) as far:
            os.set_blocking(far, False)
            self._far = far
            yield
            self._far = None

    @singledispatchmethod
    def show(self, said: object) -> None:
        """What is said by a sensor that has no device here is left out."""

    @show.register
    def _(self, ticks: WheelTicks) -> None:
        for line, (before, now) in enumerate(zip(self.counts, ticks.counts, strict=True)):
            self._gpio.pulse(line, now - before)
        self.counts = ticks.counts

    @show.register
    def _(self, gyro: Gyro) -> None:
        self._turn(gyro.rate_rad_s)

    def _turn(self, rate_rad_s: float) -> None:
        self._chip.show(LEVEL, TEMPERATURE, (0, 0, round(rate_rad_s * STEPS_PER_RAD_S)))

    @show.register
    def _(self, ranges: Ranges) -> None:
        if self._far is not None:
            line = "R," + ";".join(f"{reading.anchor},{reading.range_m:.3f}" for reading in ranges.readings)
            with suppress(BlockingIOError):
                os.write(self._far, line.encode() + b"\n")

    @show.register
    def _(self, command: MotorCommand) -> None:
        self._controller.sendto(json.dumps(command.wheel_speeds_m_s).encode(), str(MOTORS))

    @show.register
    def _(self, truth: Truth) -> None:
        self._air.pose = Pose(truth.x, truth.y, truth.heading or 0.0)
