"""The bias of a gyro while the robot stands, which the wheels show.

A bias is measured over five seconds in which no wheel counted and the gyro was quiet, and reported as a diagnostic of
the gyro; the recording keeps the raw rates. One that differs from the last by more than a gyro drifts while it stands
was a hand that turned the robot, and is reported as such.
"""

from __future__ import annotations

import math
from statistics import fmean, stdev

from fusion import Diagnostic, DriverOutput, Level
from fusion.values import Gyro, WheelTicks, nanoseconds

STAND_NS = nanoseconds(5.0)
QUIET_RAD_S = 0.02
"""Greatest standard deviation of a gyro that lies still: ten times that of a cheap one."""
MOVED_RAD_S = 0.01
"""A step between two standstills that no drift explains (0.6 degrees a second)."""
LEAST_SAMPLES = 20


class Standstill:
    """Watches the outputs of the sensors, and reports a bias at the end of five seconds of standstill."""

    def __init__(self) -> None:
        self._counts: dict[str, tuple[int, ...]] = {}
        self._since_ns: int | None = None
        self._rates: dict[str, list[float]] = {}
        self._last: dict[str, float] = {}

    def take(self, output: DriverOutput) -> list[Diagnostic]:
        """The biases that ``output`` completes."""
        if isinstance(output, WheelTicks):
            return self._wheels(output)
        if isinstance(output, Gyro) and self._since_ns is not None and output.time_ns >= self._since_ns:
            self._rates.setdefault(output.sensor, []).append(output.rate_rad_s)
        return []

    def _wheels(self, ticks: WheelTicks) -> list[Diagnostic]:
        stands = self._counts.get(ticks.sensor) == ticks.counts
        self._counts[ticks.sensor] = ticks.counts
        if not stands:
            self._since_ns, self._rates = None, {}
            return []
        if self._since_ns is None:
            self._since_ns = ticks.time_ns
        if ticks.time_ns - self._since_ns < STAND_NS:
            return []
        biases = [
            diagnostic
            for sensor, rates in self._rates.items()
            for diagnostic in self._bias(ticks.time_ns, sensor, rates)
        ]
        self._since_ns, self._rates = ticks.time_ns, {}
        return biases

    def _bias(self, time_ns: int, sensor: str, rates: list[float]) -> list[Diagnostic]:
        if len(rates) < LEAST_SAMPLES or (spread := stdev(rates)) > QUIET_RAD_S:
            return []
        bias = fmean(rates)
        moved = abs(bias - self._last.get(sensor, bias)) > MOVED_RAD_S
        if not moved:
            self._last[sensor] = bias
        values = {
            "bias_rad_s": bias,
            "bias_std_rad_s": spread / math.sqrt(len(rates)),
            "noise_std_rad_s": spread,
            "samples": len(rates),
        }
        text = "turned while the wheels stood" if moved else "bias at standstill"
        named = tuple((key, repr(value)) for key, value in values.items())
        return [Diagnostic(time_ns, sensor, Level.WARN if moved else Level.OK, text, named)]
