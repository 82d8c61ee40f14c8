"""`fusion sensors test`: every sensor of a robot run for a while, and a report of it, to be attached.

Such a report proves what needs the hardware: device, firmware, rates, the spread of the intervals, the diagnostics, and
the computer it ran on.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import threading
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fusion import BootClock, Diagnostic, DriverError, FusionError, __version__
from fusion.values import seconds
from sensors.onboard.computer import clock_sync
from sensors.onboard.driver_lifecycle import DriverLifecycle, Received, State
from sensors.onboard.robot_file import RobotFile, build_driver
from sensors.onboard.supervisor import HUNG_S

MODEL = Path("/proc/device-tree/model")
LAST_DIAGNOSTICS = 20
SECONDS = 20.0
HUNG = {"state": State.STALLED.value, "error": "its device holds the driver up", "messages": 0}


def self_test(robot: RobotFile, duration_s: float = SECONDS) -> dict[str, Any]:
    """Run all sensors of ``robot`` side by side for ``duration_s``; a report as plain values."""
    clock = BootClock()
    rows: dict[str, dict[str, Any]] = {}
    began = clock_sync()

    def watch(name: str, lifecycle: DriverLifecycle) -> None:
        outputs: list[Received] = []
        while seconds(clock.now_ns() - began.boot_ns) < duration_s:
            outputs += lifecycle.step(0.1)
        rows[name] = _row(lifecycle, outputs)
        lifecycle.close()

    threads = []
    for sensor in robot.sensors:
        try:
            lifecycle = DriverLifecycle(sensor.name, build_driver(sensor, clock), clock)
        except DriverError as error:
            rows[sensor.name] = {"state": State.FAILED.value, "error": str(error)}
            continue
        threads.append(threading.Thread(target=watch, args=(sensor.name, lifecycle), daemon=True))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(duration_s + HUNG_S)
    sensors = [
        {"name": s.name, "use": s.use, "asked_for": dict(s.settings), **rows.get(s.name, HUNG)} for s in robot.sensors
    ]
    return {**_computer(), "duration_s": duration_s, "clocks": began._asdict(), "sensors": sensors}


def _row(lifecycle: DriverLifecycle, outputs: Sequence[Received]) -> dict[str, Any]:
    """Results of one sensor: its rate, the spread of its intervals, the ages of its messages at arrival."""
    diagnostics = [one.output for one in outputs if isinstance(one.output, Diagnostic)]
    measured = [one for one in outputs if not isinstance(one.output, Diagnostic)]
    intervals = [seconds(later.output.time_ns - earlier.output.time_ns) for earlier, later in pairwise(measured)]
    ages = [seconds(one.received_ns - one.output.time_ns) for one in measured]
    info = lifecycle.info
    return {
        "state": lifecycle.state.value,
        "error": str(lifecycle.error or ""),
        "device": info and {**info._asdict(), "settings": dict(info.settings)},
        "nominal_hz": lifecycle.driver.spec.nominal_hz,
        "messages": len(measured),
        "rate_hz": len(intervals) / sum(intervals) if sum(intervals) > 0.0 else None,
        "interval_s": _spread(intervals),
        "age_s": _spread(ages),
        "losses": lifecycle.losses,
        "diagnostics": Counter(f"{diagnostic.level.name} {diagnostic.text}" for diagnostic in diagnostics).most_common(
            LAST_DIAGNOSTICS
        ),
        "last": [repr(one.output) for one in measured[-2:]],
    }


def _spread(numbers: Sequence[float]) -> dict[str, float] | None:
    if not numbers:
        return None
    marks = np.quantile(numbers, (0.0, 0.5, 0.99, 1.0))
    return dict(zip(("least", "median", "p99", "most"), map(float, marks), strict=True))


def _computer() -> dict[str, Any]:
    try:
        model = MODEL.read_text().rstrip("\0\n")
    except OSError:
        model = ""
    return {
        "fusion": __version__,
        "computer": model or platform.machine(),
        "kernel": platform.release(),
        "python": platform.python_version(),
    }


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion sensors test`."""
    parser.add_argument("robot", metavar="ROBOT.toml", type=Path, help="the robot file")
    parser.add_argument("-o", "--output", metavar="REPORT.json", type=Path, help="write the report there")
    parser.add_argument("--seconds", metavar="S", type=float, default=SECONDS, help="how long (default %(default)g)")


def run(arguments: argparse.Namespace) -> int:
    """Test and report; 1 when a sensor was silent, or was not running at the end."""
    report = self_test(RobotFile.load(arguments.robot), arguments.seconds)
    text = json.dumps(report, indent=2, default=str) + "\n"
    if arguments.output is not None:
        try:
            arguments.output.write_text(text)
        except OSError as error:
            raise FusionError(
                f"{arguments.output}: cannot be written ({error.strerror}); give another place"
            ) from error
        text = "".join(map(_line, report["sensors"])) + f"{arguments.output}\n"
    sys.stdout.write(text)
    return int(any(row["state"] != State.RUNNING.value or not row["messages"] for row in report["sensors"]))


def _line(row: dict[str, Any]) -> str:
    if row["state"] != State.RUNNING.value:
        return f"{row['name']}: {row['state']}: {row['error']}\n"
    interval = row["interval_s"]
    spread = "" if interval is None else f", {interval['median']:.4g} s apart ({interval['most']:.4g} at most)"
    rate = "" if row["rate_hz"] is None else f", {row['rate_hz']:.2f} Hz"
    return f"{row['name']}: {row['messages']} messages{rate}{spread}\n"
