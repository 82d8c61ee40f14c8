"""The simulated robot as drivers, one per sensor, for trials of a robot's software before there is a robot.

All sensors on one clock that name the same scenario and seed belong to one robot, which starts when the first of them
is built. On a virtual clock a run takes no time, on the kernel's as long as a real one. Setting ``faults`` lists what
goes wrong (`sensors.simulation.sensor_fault`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import ClassVar

from fusion.driver import Clock, DeviceInfo, Diagnostic, DriverOutput, DriverSpec, Found, Level, VirtualClock
from fusion.errors import DeviceLostError, NotFoundError, SettingError, WorldError
from fusion.values import Gyro, Measurement, MotorCommand, Ranges, Truth, WheelTicks, WifiScan, seconds
from sensors.simulation.robot import SimulatedRobot
from sensors.simulation.scenario import load_scenario
from sensors.simulation.sensor_fault import read_faults

LEAST_SHARE = 0.5
"""Share of its rate below which a simulated sensor counts as silent."""
FAKE = MappingProxyType({"scenario": "room"})
"""Settings of a fake device: a short drive with every kind of sensor."""


class Simulation:
    """One robot in one scenario, started when this is built, with its unplugged and its garbled sensors."""

    def __init__(self, scenario: str, seed: int, clock: Clock) -> None:
        try:
            self.scenario = load_scenario(scenario)
        except WorldError as error:
            raise SettingError(str(error), "`fusion simulate --help` lists the scenarios") from error
        self.clock = clock
        self.start_ns = clock.now_ns()
        self.messages = tuple(SimulatedRobot(self.scenario, seed).run())
        self.unplugged: set[type[Measurement | Truth]] = set()
        self.garbled: set[type[Measurement | Truth]] = set()

    def elapsed_ns(self) -> int:
        """Time since the robot started."""
        return self.clock.now_ns() - self.start_ns


simulation = lru_cache(maxsize=4)(Simulation)
"""The robot of a scenario, a seed and a clock: the same one whoever asks."""


class SimulatedSensor:
    """Base of all simulated sensors; robot files name a subclass."""

    summary: ClassVar[str]
    kind: ClassVar[type[Measurement | Truth]]
    rate: ClassVar[str] = ""
    """Key of its rate in the scenario's reality; "" for a sensor that sends at events."""

    def __init__(
        self,
        name: str,
        clock: Clock,
        *,
        scenario: str = "office",
        seed: int = 0,
        faults: Sequence[Mapping[str, object]] = (),
    ) -> None:
        self._name = name
        self._faults = read_faults(faults, name)
        self._robot = simulation(scenario, seed, clock)
        self._script = [message for message in self._robot.messages if isinstance(message, self.kind)]
        self._about = {"scenario": scenario, "seed": seed}
        self._at = 0
        self._is_open = False
        hz = float(getattr(self._robot.scenario.reality, self.rate)) if self.rate else 0.0
        self.spec = DriverSpec((self.kind,), hz, LEAST_SHARE * hz)

    @classmethod
    def discover(cls) -> list[Found]:
        """A simulated sensor is always there."""
        return [Found("simulated", cls.summary, MappingProxyType({}))]

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[SimulatedDevice]:
        """The sensor of a short drive on a virtual clock of its own."""
        yield SimulatedDevice(cls.kind)

    def open(self) -> DeviceInfo:
        """Begin with what is measured from now on; raises `SettingError` where the scenario has no such sensor."""
        if not self._script:
            raise SettingError(f"{self._name}: this robot has no such sensor", f"leave it out ({self._about})")
        if not self._is_there():
            raise NotFoundError(f"{self._name}: the simulated device is unplugged", "plug it in")
        now_ns = self._robot.elapsed_ns()
        while self._at < len(self._script) and self._script[self._at].time_ns < now_ns:
            self._at += 1
        self._is_open = True
        return DeviceInfo(f"simulated {self.kind.__name__}", settings=self._about)

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """Outputs that are due, after a wait for the first of them."""
        if not self._is_open or not self._is_there():
            raise DeviceLostError(f"{self._name}: the simulated device is gone", "plug it in")
        clock = self._robot.clock
        if self.kind in self._robot.garbled:
            self._robot.garbled.remove(self.kind)
            return [Diagnostic(clock.now_ns(), self._name, Level.WARN, "a reading that cannot be understood")]
        if self._at == len(self._script):
            raise DeviceLostError(f"{self._name}: the simulated drive is over", "stop, or drive a longer scenario")
        clock.sleep(min(seconds(self._script[self._at].time_ns - self._robot.elapsed_ns()), timeout_s))
        return list(self._due())

    def close(self) -> None:
        """Close the device."""
        self._is_open = False

    def _is_there(self) -> bool:
        elapsed_ns = self._robot.elapsed_ns()
        return self.kind not in self._robot.unplugged and not any(f.unplugs(elapsed_ns) for f in self._faults)

    def _due(self) -> Iterator[DriverOutput]:
        """Outputs that fell due since the last poll, changed by the faults."""
        now_ns = self._robot.elapsed_ns()
        while self._at < len(self._script) and self._script[self._at].time_ns <= now_ns:
            message: Measurement | Truth | None = self._script[self._at]
            self._at += 1
            for fault in self._faults:
                message = None if message is None else fault.apply(message)
            if message is not None:
                yield self._stamped(message)

    def _stamped(self, message: Measurement | Truth) -> DriverOutput:
        time_ns = max(message.time_ns + self._robot.start_ns, 0)  # no clock that counts from boot shows less
        if isinstance(message, Truth):
            return message._replace(time_ns=time_ns)
        return replace(message, time_ns=time_ns, sensor=self._name)


class SimulatedEncoders(SimulatedSensor):
    """Wheel encoders."""

    summary, kind, rate = "wheel encoders of a simulated robot", WheelTicks, "ticks_hz"


class SimulatedMotors(SimulatedSensor):
    """Commands to the motors."""

    summary, kind = "motor commands of a simulated robot with single-channel encoders", MotorCommand

    def open(self) -> DeviceInfo:
        """As for all; the command in force comes first, since the direction of the wheels depends on it."""
        info = super().open()
        before = self._script[self._at - 1] if self._at else None
        self._standing = before if isinstance(before, MotorCommand) else None
        return info

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """As for all, the command in force first."""
        if self._standing is None:
            return super().poll(timeout_s)
        standing, self._standing = self._standing, None
        return [self._stamped(replace(standing, time_ns=self._robot.elapsed_ns()))]


class SimulatedGyro(SimulatedSensor):
    """A gyro."""

    summary, kind, rate = "gyro of a simulated robot", Gyro, "gyro_hz"


class SimulatedWifi(SimulatedSensor):
    """Wi-Fi signal strengths."""

    summary, kind, rate = "Wi-Fi signal strengths of a simulated robot", WifiScan, "wifi_hz"


class SimulatedRanges(SimulatedSensor):
    """UWB ranges."""

    summary, kind, rate = "UWB ranges of a simulated robot", Ranges, "range_hz"


class SimulatedTracker(SimulatedSensor):
    """A motion-capture system that measures the true pose of the robot."""

    summary, kind, rate = "true pose of a simulated robot", Truth, "truth_hz"


class SimulatedDevice:
    """The device of one simulated sensor under test, on a virtual clock."""

    def __init__(self, kind: type[Measurement | Truth]) -> None:
        self.clock = VirtualClock()
        self.settings: Mapping[str, object] = FAKE
        self._kind = kind
        self._robot = simulation(FAKE["scenario"], 0, self.clock)

    def speak(self) -> None:
        """Let time pass until just before the sensor's next message."""
        elapsed_ns = self._robot.elapsed_ns()
        due = (s.time_ns for s in self._robot.messages if isinstance(s, self._kind) and s.time_ns > elapsed_ns)
        self.clock.sleep(seconds(next(due, elapsed_ns) - elapsed_ns - 1))

    def garble(self) -> None:
        """Let it send something that cannot be parsed."""
        self._robot.garbled.add(self._kind)

    def unplug(self) -> None:
        """Take it away."""
        self._robot.unplugged.add(self._kind)

    def plug(self) -> None:
        """Give it back."""
        self._robot.unplugged.discard(self._kind)
