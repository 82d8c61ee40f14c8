"""Raw data of the motion sensors: speeds and turn rates over time, and events of the devices."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from benchmarks.review.canvas import Canvas
from fusion import Diagnostic, Gyro, Level, Measurement, MotorCommand, Odometry, WheelTicks, World
from fusion.arrays import Floats, Stamps
from fusion.output.colours import PALETTE
from fusion.values import NANOSECONDS
from logs.devices import OPENED, STATUS, as_line
from logs.run import Run

SPEED, TURN_RATE = "speed", "turn_rate"
"""The two plots: [m/s] and [deg/s]."""

Series = dict[tuple[str, str], tuple[Stamps, Floats]]
"""(time [ns], value) columns by plot and name."""
Kind = TypeVar("Kind", WheelTicks, MotorCommand, Odometry, Gyro)


def draw_raw_sensors(canvas: Canvas, series: Series) -> None:
    """A line per sensor, or per wheel of one; the colours start anew in each plot."""
    for plot in (SPEED, TURN_RATE):
        own = [(name, columns) for (place, name), columns in series.items() if place == plot]
        for number, (name, (time_ns, values)) in enumerate(own):
            canvas.line(["raw", plot, name], name, PALETTE[number % len(PALETTE)], time_ns, values, width=1.0)


def raw_series(world: World, measurements: Sequence[Measurement]) -> Series:
    """The motion sensors among ``measurements``."""
    series: Series = {}
    for sensor, ticks in _by_sensor(measurements, WheelTicks).items():
        series |= _wheel_speeds(sensor, ticks, world.robot.distance_per_tick_m)
    for sensor, commands in _by_sensor(measurements, MotorCommand).items():
        time_ns, speeds = _stamps(commands), np.array([command.wheel_speeds_m_s for command in commands])
        series |= {(SPEED, f"{sensor} wheel {i}"): (time_ns, speeds[:, i]) for i in range(speeds.shape[1])}
    for sensor, steps in _by_sensor(measurements, Odometry).items():
        series |= _odometry_rates(sensor, steps)
    for sensor, gyro in _by_sensor(measurements, Gyro).items():
        rates = np.degrees(np.array([reading.rate_rad_s for reading in gyro], dtype=np.float64))
        series[TURN_RATE, sensor] = _stamps(gyro), rates
    return series


def _by_sensor(measurements: Sequence[Measurement], kind: type[Kind]) -> dict[str, list[Kind]]:
    """Those of one kind by sensor, in time order, each stamp once."""
    by_sensor: dict[str, dict[int, Kind]] = defaultdict(dict)
    for measurement in measurements:
        if isinstance(measurement, kind):
            by_sensor[measurement.sensor][measurement.time_ns] = measurement
    return {sensor: [own[time_ns] for time_ns in sorted(own)] for sensor, own in sorted(by_sensor.items())}


def _stamps(measurements: Sequence[Measurement]) -> Stamps:
    return np.array([measurement.time_ns for measurement in measurements], dtype=np.int64)


def _wheel_speeds(sensor: str, ticks: Sequence[WheelTicks], distance_per_tick_m: float) -> Series:
    """From one message to the next [m/s]; a speed stands at the later one."""
    time_ns = _stamps(ticks)
    rolled_m = np.diff(np.array([tick.counts for tick in ticks]), axis=0) * distance_per_tick_m
    speeds = rolled_m / (np.diff(time_ns)[:, None] / NANOSECONDS)
    return {(SPEED, f"{sensor} wheel {i}"): (time_ns[1:], speeds[:, i]) for i in range(speeds.shape[1])}


def _odometry_rates(sensor: str, steps: Sequence[Odometry]) -> Series:
    """Mean speed and turn rate over each increment that was measured and takes time."""
    taken = [step for step in steps if step.measured and step.time_ns > step.from_ns]
    span_s = np.array([step.time_ns - step.from_ns for step in taken], dtype=np.float64) / NANOSECONDS
    time_ns, distance_m = _stamps(taken), np.array([step.distance_m for step in taken], dtype=np.float64)
    turn_deg = np.degrees(np.array([step.turn_rad for step in taken], dtype=np.float64))
    return {(SPEED, sensor): (time_ns, distance_m / span_s), (TURN_RATE, sensor): (time_ns, turn_deg / span_s)}


DEVICES = "devices"
LEVELS = {Level.OK: "INFO", Level.WARN: "WARN", Level.ERROR: "ERROR"}


def worth_a_line(run: Run) -> Sequence[Diagnostic]:
    """Diagnostics that are no routine: those that come each second, or beside each scan, are left out."""
    return [r for r in run.diagnostics if r.text == OPENED or (r.level is not Level.OK and r.text != STATUS)]


def draw_device_events(canvas: Canvas, diagnostics: Sequence[Diagnostic]) -> None:
    """A line for each; nothing for a run without."""
    if diagnostics:
        time_ns = np.array([diagnostic.time_ns for diagnostic in diagnostics], dtype=np.int64)
        levels = [LEVELS[diagnostic.level] for diagnostic in diagnostics]
        canvas.text(["events", DEVICES], time_ns, levels, [as_line(diagnostic) for diagnostic in diagnostics])
