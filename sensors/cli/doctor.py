"""`fusion doctor`: examination of everything that a recording needs, with the cure for each thing that is wrong.

It opens no device and changes nothing but one small file that it writes and removes.
"""

from __future__ import annotations

import argparse
import grp
import importlib.util
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from fusion import Advice, BootClock, Driver, FusionError, LogError, Measurement, Truth
from fusion.driver import Needs
from logs.wheel_direction import caution
from sensors.device_errors import INSTALL
from sensors.onboard.computer import is_clock_synced
from sensors.onboard.robot_file import RobotFile, Sensor, build_driver
from sensors.onboard.rolling_log import check_space

CAPABILITIES = {"CAP_NET_ADMIN": 12, "CAP_NET_RAW": 13, "CAP_SYS_RAWIO": 17, "CAP_SYS_NICE": 23}
"""Bits of a process's capability sets (linux/capability.h)."""
STATUS = Path("/proc/self/status")
CLOCKS = Path("/dev")
SLOWEST_SYNC_S = 0.5
"""A disk that takes longer to sync than this delays the whole recording: it does so each second."""
SYNCS = 10


def examine(robot: RobotFile, folder: Path) -> list[Advice]:
    """Everything that ``robot`` needs to be recorded into ``folder``."""
    sensors = [advice for sensor in robot.sensors for advice in _sensor(sensor)]
    return [*_clock(), *_disk(folder, robot.policy.min_free_mb), *sensors, *_direction(robot)]


def _sensor(sensor: Sensor) -> Iterator[Advice]:
    """The driver of one sensor, its needs, its device, and its own advice."""
    try:
        driver = build_driver(sensor, BootClock())
    except FusionError as error:
        yield Advice(False, f"{sensor.name}: {error}", "correct the robot file")
        return
    yield Advice(True, f"{sensor.name}: {driver.summary}")
    yield from _needs(sensor.name, driver.spec.needs)
    yield from _devices(sensor, driver)
    yield from getattr(driver, "advise", list)()


def _direction(robot: RobotFile) -> Iterator[Advice]:
    """Whether the sensors that can be built show which way the wheels turn."""
    clock, kinds = BootClock(), set[type[Measurement | Truth]]()
    for sensor in robot.sensors:
        with suppress(FusionError):
            kinds.update(build_driver(sensor, clock).spec.kinds)
    if advice := caution(robot.world.robot, kinds):
        yield advice


def _needs(name: str, needs: Needs) -> Iterator[Advice]:
    for module in needs.modules:
        there = importlib.util.find_spec(module) is not None
        yield Advice(there, f"{name}: the package {module} is {'there' if there else 'missing'}", INSTALL)
    for capability in needs.capabilities:
        held = holds_capability(capability)
        word = capability.removeprefix("CAP_").lower()
        cure = (
            f"run it as a service with AmbientCapabilities={capability}, or by sudo setpriv --reuid $USER "
            f"--init-groups --inh-caps +{word} --ambient-caps +{word} fusion record ..."
        )
        yield Advice(held, f"{name}: {capability} is {'held' if held else 'not held'}", cure)
    for group in needs.groups:
        member = is_in_group(group)
        cure = f"sudo usermod -aG {group} $USER, and log in again"
        yield Advice(member, f"{name}: you are {'' if member else 'not '}in the group {group}", cure)


def _devices(sensor: Sensor, driver: Driver) -> Iterator[Advice]:
    devices = ", ".join(f"{device.id} ({device.about})" for device in driver.discover())
    cure = f"plug it in; docs/drivers.md names the page of {sensor.use}, with its wiring"
    yield Advice(bool(devices), f"{sensor.name}: {devices or 'no such device is present'}", cure)


def _clock() -> Iterator[Advice]:
    synced = is_clock_synced()
    yield Advice(synced, f"the wall clock is {'' if synced else 'not '}synchronised", "timedatectl set-ntp true")
    has_clock = any(CLOCKS.glob("rtc*"))
    cure = "add a clock module; without one the date is wrong after a boot without network (stamps are not)"
    yield Advice(has_clock, f"this computer has {'a' if has_clock else 'no'} clock that runs while it is off", cure)


def _disk(folder: Path, min_free_mb: float) -> Iterator[Advice]:
    try:
        check_space(folder, min_free_mb)
        slowest_s = slowest_sync_s(folder)
    except (LogError, OSError) as error:
        yield Advice(False, str(error), "choose another place by -o, or free some space")
        return
    cure = "take a faster card, or record to another disk"
    yield Advice(slowest_s <= SLOWEST_SYNC_S, f"{folder}: a sync takes up to {1000.0 * slowest_s:.0f} ms", cure)


def slowest_sync_s(folder: Path) -> float:
    """The longest of a few syncs of as much as a second of recording [s]; raises `OSError` where it cannot write."""
    took_s = []
    with tempfile.TemporaryFile(dir=folder) as file:
        for _ in range(SYNCS):
            file.write(os.urandom(10_000))
            began = time.perf_counter()
            file.flush()
            os.fsync(file.fileno())
            took_s.append(time.perf_counter() - began)
    return max(took_s)


def holds_capability(name: str) -> bool:
    """Whether this process has a Linux capability."""
    rows = dict(line.split(":", 1) for line in STATUS.read_text().splitlines() if ":" in line)
    return bool(int(rows.get("CapEff", "0"), 16) >> CAPABILITIES[name] & 1)


def is_in_group(name: str) -> bool:
    """Whether this process belongs to a group, or is root, who needs none."""
    try:
        return os.geteuid() == 0 or grp.getgrnam(name).gr_gid in os.getgroups()
    except KeyError:
        return False


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of `fusion doctor`."""
    parser.add_argument("robot", metavar="ROBOT.toml", type=Path, help="the robot file")
    parser.add_argument("-o", "--output", metavar="FOLDER", type=Path, default=Path(), help="where it will record")
    parser.add_argument("--json", action="store_true", help="as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Examine and report; 1 when something needs attention."""
    advices = examine(RobotFile.load(arguments.robot), arguments.output)
    if arguments.json:
        sys.stdout.write(json.dumps([advice._asdict() for advice in advices], indent=2) + "\n")
    else:
        sys.stdout.write(_text(advices))
    return int(not all(advice.is_well for advice in advices))


def _text(advices: Sequence[Advice]) -> str:
    lines = []
    for advice in advices:
        lines.append(f"{'well' if advice.is_well else 'FIX '}  {advice.what}")
        if not advice.is_well and advice.cure:
            lines.append(f"      ↳ {advice.cure}")
    well = sum(advice.is_well for advice in advices)
    lines.append(f"{well} of {len(advices)} checks passed")
    return "\n".join(lines) + "\n"
