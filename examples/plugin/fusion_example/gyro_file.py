"""A sensor: a gyro whose readings another program appends to a file, one turn rate [rad/s] a line."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

from fusion import Gyro
from fusion.driver import Clock, DeviceInfo, Diagnostic, DriverOutput, DriverSpec, Found, Level, VirtualClock
from fusion.errors import DeviceLostError, NotFoundError

REMEDY = "start the program that writes it"


class GyroFile:
    """A file as a device: it is lost when the file is taken away."""

    summary: ClassVar[str] = "turn rates that another program appends to a file"

    def __init__(self, name: str, clock: Clock, *, path: str = "gyro.txt", hz: float = 50.0) -> None:
        self.spec = DriverSpec((Gyro,), hz, hz / 2.0)
        self._name, self._clock, self._path = name, clock, Path(path)
        self._file: io.BufferedReader | None = None
        self._seq = 0

    @classmethod
    def discover(cls) -> list[Found]:
        """None: a file may be anywhere."""
        return []

    def open(self) -> DeviceInfo:
        """Skip the lines that are there already: they are old."""
        try:
            self._file = self._path.open("rb")
        except OSError as error:
            raise NotFoundError(f"{self._name}: {self._path} cannot be opened ({error})", REMEDY) from error
        self._file.seek(0, io.SEEK_END)
        return DeviceInfo("gyro file", settings={"path": str(self._path)})

    def poll(self, timeout_s: float) -> list[DriverOutput]:
        """The lines that were appended since."""
        if self._file is None or not self._path.exists():
            raise DeviceLostError(f"{self._name}: {self._path} is gone", REMEDY)
        lines = self._file.readlines()
        if lines and not lines[-1].endswith(b"\n"):
            self._file.seek(-len(lines.pop()), io.SEEK_CUR)  # the rest of it is still being written
        if not lines:
            self._clock.sleep(timeout_s)
        return [self._parse(line) for line in lines]

    def _parse(self, line: bytes) -> DriverOutput:
        try:
            rate_rad_s = float(line)
        except ValueError:
            return Diagnostic(self._clock.now_ns(), self._name, Level.WARN, f"{line!r} is no number")
        self._seq += 1
        return Gyro(self._clock.now_ns(), self._name, self._seq, rate_rad_s)

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
        self._file = None

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeFile]:
        """A file in a folder of its own."""
        with tempfile.TemporaryDirectory() as folder:
            device = FakeFile(Path(folder) / "gyro.txt")
            device.plug()
            yield device


class FakeFile:
    """The device that the conformance kit plays on."""

    def __init__(self, path: Path) -> None:
        self.clock, self.settings, self._path = VirtualClock(), {"path": str(path)}, path

    def speak(self) -> None:
        """Append a reading."""
        self._append(b"0.01\n")

    def garble(self) -> None:
        """Append what is no number."""
        self._append(b"noon\n")

    def unplug(self) -> None:
        """Take the file away."""
        self._path.unlink(missing_ok=True)

    def plug(self) -> None:
        """Make an empty file."""
        self._path.touch()

    def _append(self, line: bytes) -> None:
        with self._path.open("ab") as file:
            file.write(line)
