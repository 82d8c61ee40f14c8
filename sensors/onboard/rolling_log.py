"""A recording as a series of logs, each whole by itself: world, robot file, devices and clocks stand in every one.

Files are called ``NAME-BOOT-NUMBER.mcap``: the number goes on where the last recording of this boot ended, so nothing
is ever overwritten and a wall clock that is wrong does no harm. Only the first file of a recording knows where the
robot stood at the start; `fusion join` makes one log of them all.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType, TracebackType

from fusion import DeviceInfo, Diagnostic, Level, LogError, Prior, Truth, Update, __version__
from fusion.values import nanoseconds
from logs.devices import OPENED
from logs.writer import RunWriter
from sensors.onboard.computer import boot_id, clock_sync, free_bytes
from sensors.onboard.driver_lifecycle import Received
from sensors.onboard.gyro_bias import Standstill
from sensors.onboard.robot_file import RobotFile

MEGABYTE = 1_000_000
ROBOT_FILE = "robot.toml"
"""The attachment that holds the robot file."""


class RollingLog:
    """Files of a recording; a context manager, owned by one thread. Raises `LogError` where one cannot be written."""

    def __init__(
        self, robot: RobotFile, folder: Path, prior: Prior, about: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """Begin the first file; ``about`` goes into the metadata of every one."""
        self.paths: list[Path] = []
        self._robot = robot
        self._folder = folder
        self._about = about
        self._stem = f"{_plain(robot.name)}-{boot_id()}"
        self._number = _next_number(folder, self._stem)
        self._first = f"{self._stem}-{self._number:04d}"
        self._began_ns = prior.time_ns
        self._devices: dict[str, DeviceInfo] = {}
        self._standstill = Standstill()
        self._log = self._begin(prior)

    def __enter__(self) -> RollingLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Finish the last file."""
        self._log.close()

    def write(self, received: Received) -> None:
        """Append an output of a driver, at the time it was received."""
        output, at_ns = received.output, received.received_ns
        if isinstance(output, Diagnostic):
            self._log.write_diagnostic(output, log_time_ns=at_ns)
        elif isinstance(output, Truth):
            self._log.write_truth(output, log_time_ns=at_ns)
        else:
            self._log.write(output, log_time_ns=at_ns)
        for diagnostic in self._standstill.take(output):
            self._log.write_diagnostic(diagnostic, log_time_ns=at_ns)

    def write_update(self, estimator: str, update: Update, now_ns: int) -> None:
        """Append an update of an estimator by what was received at ``now_ns``."""
        self._log.write_update(estimator, update, log_time_ns=now_ns)

    def note(self, about: Mapping[str, str]) -> None:
        """Add what is known only at the end to the metadata of the last file."""
        self._log.note(about)

    def write_clock(self) -> None:
        """Append the clocks at this moment."""
        self._log.write_clock(clock_sync())

    def write_devices(self, devices: Mapping[str, DeviceInfo], now_ns: int) -> None:
        """Append the descriptions of devices that are new or opened again."""
        for name, info in devices.items():
            if self._devices.get(name) is not info:
                self._devices[name] = info
                self._log.write_diagnostic(_about(name, info, now_ns))

    def split_if_due(self, now_ns: int) -> None:
        """Go on in a new file when this one is old or large enough."""
        policy, path = self._robot.policy, self.paths[-1]
        is_old = now_ns - self._began_ns >= nanoseconds(policy.split_s)
        if is_old or path.stat().st_size >= policy.split_mb * MEGABYTE:
            self._log.close()
            self._number += 1
            self._began_ns = now_ns
            self._log = self._begin(None)
            for name, info in self._devices.items():
                self._log.write_diagnostic(_about(name, info, now_ns))

    def lacks_mb(self) -> float:
        """Free space that the disk lacks by the policy [MB], after the ring gave up what it may."""
        wanted = self._robot.policy.min_free_mb * MEGABYTE
        while self._robot.policy.ring and free_bytes(self._folder) < wanted and (oldest := self._oldest()):
            oldest.unlink()
        return (wanted - free_bytes(self._folder)) / MEGABYTE

    def _oldest(self) -> Path | None:
        """The oldest file of this robot beside the one being written."""
        files = self._folder.glob(f"{_plain(self._robot.name)}-*.mcap")
        return min((f for f in files if f != self.paths[-1]), key=lambda f: f.stat().st_mtime_ns, default=None)

    def _begin(self, prior: Prior | None) -> RunWriter:
        path = self._folder / f"{self._stem}-{self._number:04d}.mcap"
        about = {
            **self._about,
            "source": "recorded",
            "recording": self._first,
            "split": str(len(self.paths)),
            "clock": "CLOCK_BOOTTIME",
            "fusion": __version__,
        }
        log = RunWriter(
            path,
            self._robot.world,
            name=path.stem,
            prior=prior,
            metadata=about,
            attachments={ROBOT_FILE: self._robot.text.encode()},
        )
        self.paths.append(path)
        log.write_clock(clock_sync())
        return log


def check_space(folder: Path, min_free_mb: float) -> None:
    """Refuse to begin where the recording would have to stop at once; raises `LogError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        free_mb = free_bytes(folder) / MEGABYTE
    except OSError as error:
        raise LogError(f"{folder}: cannot be written ({error}); choose another place") from error
    if free_mb < min_free_mb:
        raise LogError(
            f"{folder}: {free_mb:.0f} MB are free, the recording wants {min_free_mb:g} MB to stay so; "
            "remove something, lower --min-free, or give up old files with --ring"
        )


def _about(name: str, info: DeviceInfo, now_ns: int) -> Diagnostic:
    """A device as a diagnostic."""
    settings = json.dumps(dict(info.settings), default=str, sort_keys=True)
    values = (("model", info.model), ("serial", info.serial), ("firmware", info.firmware), ("settings", settings))
    return Diagnostic(now_ns, name, Level.OK, OPENED, values)


def _plain(name: str) -> str:
    """A name fit for a file."""
    return re.sub(r"[^A-Za-z0-9_]+", "_", name) or "robot"


def _next_number(folder: Path, stem: str) -> int:
    numbers = [match[1] for path in folder.glob(f"{stem}-*.mcap") if (match := re.search(r"-(\d+)\.mcap$", path.name))]
    return max(map(int, numbers), default=-1) + 1
