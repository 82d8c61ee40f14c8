"""Whether the direction in which wheels turn is known: encoders of a single channel take it from the motor commands.

Such an encoder counts edges and cannot see their direction. A wheel that no command has given one counts as turning
forwards, so a robot that turns on the spot seems to drive straight on, and nothing in the numbers shows it. A robot
file, a log and a running robot are judged here, all in the same sentence.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from fusion import Advice, Diagnostic, DriverOutput, Measurement, MotorCommand, Truth, WheelTicks
from fusion.robot import WHEELS, Robot
from fusion.timeline import order
from fusion.values import seconds
from logs.devices import is_down

LEAST_M = 0.1
"""Distance [m] that a wheel may roll before its direction is missed: sensors do not all begin at the same moment."""


def caution(robot: Robot, kinds: Collection[type[Measurement | Truth]], where: str = "") -> Advice | None:
    """The caution for encoders of a single channel without motor commands, None where direction is known.

    ``kinds`` are measured, or would be by the sensors of a robot file; ``where`` narrows it down to a part of a run.
    """
    if robot.encoder != "single_channel" or WheelTicks not in kinds or MotorCommand in kinds:
        return None
    return Advice(
        False,
        f"single-channel encoders without motor commands{where}: wheels that turn backwards count as forwards",
        'add a sensor of motor commands (`motors`, or `simulated_motors`), or set encoder = "quadrature" in the '
        "world's [robot] if the encoders see the direction or no wheel ever turns backwards",
    )


def caution_of_run(
    robot: Robot, measurements: Collection[Measurement], diagnostics: Iterable[Diagnostic]
) -> Advice | None:
    """The same for what was recorded: all of it without motor commands, or the parts where none held. A robot that
    stood needs none.
    """
    if caution(robot, {WheelTicks}) is None:
        return None  # the encoders see it: most logs need no closer look
    watch = DirectionWatch(robot)
    stamped = [
        *((order(m), m) for m in measurements),
        *((_order(diagnostic), diagnostic) for diagnostic in diagnostics),
    ]
    for _, output in sorted(stamped, key=lambda row: row[0]):
        watch.take(output)
    return watch.caution and (caution(robot, {type(measurement) for measurement in measurements}) or watch.caution)


def _order(diagnostic: Diagnostic) -> tuple[int, int, str, int]:
    """Before any measurement of the same time: a command that comes with the return of its sensor holds."""
    return diagnostic.time_ns, -1, diagnostic.sensor, 0


class DirectionWatch:
    """Adds up how far single-channel wheels roll in a direction that no command has stated.

    A command states the direction of the wheels it gives a speed other than zero. It holds until the next, or until
    the sensor that brought it is lost.
    """

    def __init__(self, robot: Robot) -> None:
        wheels = len(WHEELS[robot.drive])
        self._robot = robot
        self._commanders: set[str] = set()
        self._is_known = [False] * wheels
        self._ticks = [0] * wheels
        """Counted in an unknown direction, by wheel."""
        self._counts: tuple[int, ...] | None = None
        self._start_ns: int | None = None
        self._missed_ns: int | None = None

    def take(self, output: DriverOutput) -> None:
        """Follow one thing that a sensor measured, or a diagnostic of it."""
        if isinstance(output, MotorCommand) and all(map(math.isfinite, output.wheel_speeds_m_s)):
            self._commanders.add(output.sensor)
            pairs = zip(self._is_known, output.wheel_speeds_m_s, strict=False)
            self._is_known = [known or speed != 0.0 for known, speed in pairs]
        elif isinstance(output, WheelTicks):
            self._roll(output)
        elif isinstance(output, Diagnostic) and is_down(output):
            self.lose(output.sensor)

    def lose(self, sensor: str) -> None:
        """A sensor is lost; if it brought commands, nothing states any more which of them hold."""
        if sensor in self._commanders:
            self._is_known = [False] * len(self._is_known)

    @property
    def caution(self) -> Advice | None:
        """The caution for what was followed so far, None while all is known but for `LEAST_M`."""
        rolled_m = max(self._ticks, default=0) * self._robot.distance_per_tick_m
        if rolled_m <= LEAST_M or self._missed_ns is None or self._start_ns is None:
            return None
        first_s = seconds(self._missed_ns - self._start_ns)
        return caution(self._robot, {WheelTicks}, f" for {rolled_m:.2f} m of a wheel's way, first at {first_s:.1f} s")

    def _roll(self, ticks: WheelTicks) -> None:
        before, self._counts = self._counts or ticks.counts, ticks.counts
        self._start_ns = ticks.time_ns if self._start_ns is None else self._start_ns
        turned = [abs(now - then) for then, now in zip(before, ticks.counts, strict=False)]
        missed = [0 if known else count for known, count in zip(self._is_known, turned, strict=False)]
        self._ticks = [total + count for total, count in zip(self._ticks, missed, strict=False)]
        if any(missed) and self._missed_ns is None:
            self._missed_ns = ticks.time_ns
