"""A gyro that the kernel drives, through its industrial I/O files (Documentation/ABI/testing/sysfs-bus-iio).

Any chip the kernel knows: LSM6DSOX, ICM-20948, BMI270, MPU-6050. Each sample is a few files read; the kernel's buffers
need an interrupt line and are not used.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from fusion import BootClock, Clock, DeviceLostError, DriverError, Found, Needs, NotFoundError, UnsupportedError
from sensors.device_errors import device_error
from sensors.gyro.sampling import AXES, Sample, SampledGyro, UnreadableError, Vector

CURE = "load its driver: see docs/drivers-gyro.md"
SYSFS = "/sys/bus/iio/devices"
CLOCK_FILE = "current_timestamp_clock"
MONOTONIC = "monotonic"
TEMPERATURES = ("in_temp_raw", "in_temp_offset", "in_temp_scale")


class GyroIio(SampledGyro):
    """A gyro of the kernel's; ``device`` is its name (as ``mpu6050``) or ``iio:deviceN``; "" is the first."""

    summary: ClassVar[str] = "gyro driven by the kernel (industrial I/O)"
    needs = Needs()

    def __init__(
        self, name: str, clock: Clock, *, device: str = "", axis: str = "+z", hz: float = 100.0, sysfs: str = SYSFS
    ) -> None:
        super().__init__(name, clock, axis=axis, hz=hz)
        self._wanted, self._sysfs = device, Path(sysfs)
        self._folder: Path | None = None
        self._scale = self._acceleration_scale = 0.0

    @classmethod
    def discover(cls) -> list[Found]:
        """The gyros that the kernel drives."""
        return [
            Found(folder.name, _text(folder / "name"), MappingProxyType({"device": folder.name}))
            for folder in _gyros(Path(SYSFS))
        ]

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeIio]:
        """A folder with the files of a gyro."""
        with tempfile.TemporaryDirectory() as folder:
            yield FakeIio(Path(folder))

    def _start(self) -> tuple[str, dict[str, object]]:
        folder = self._find()
        try:
            self._scale = float((folder / "in_anglvel_scale").read_text())
            clock_file = folder / CLOCK_FILE
            if clock_file.exists() and clock_file.read_text().strip() != MONOTONIC:
                with suppress(PermissionError):  # only the stamps of buffers depend on it
                    clock_file.write_text(MONOTONIC)
            self._read_axes(folder, "in_anglvel")
        except ValueError as error:
            raise UnsupportedError(f"{self._name}: {folder}: {error}", "take another gyro") from error
        except OSError as error:
            raise self._refused(folder, error) from error
        has_acceleration = (folder / "in_accel_scale").exists()
        self._acceleration_scale = float((folder / "in_accel_scale").read_text()) if has_acceleration else 0.0
        self._folder = folder
        settings: dict[str, object] = {"device": folder.name, "scale": self._scale}
        frequency = _text(folder / "in_anglvel_sampling_frequency") or _text(folder / "sampling_frequency")
        return _text(folder / "name"), settings | ({"sampling_frequency_hz": frequency} if frequency else {})

    def _find(self) -> Path:
        found = _gyros(self._sysfs)
        for folder in found:
            if self._wanted in ("", folder.name, _text(folder / "name")):
                return folder
        there = ", ".join(f"{_text(folder / 'name')} ({folder.name})" for folder in found) or "none"
        what = f"{self._name}: no gyro {self._wanted!r} of the kernel; there are: {there}"
        raise NotFoundError(what, CURE)

    def _read(self) -> Sample:
        folder = self._folder
        if folder is None:
            raise DeviceLostError(f"{self._name} is not open", "open the driver first")
        try:
            rates = self._read_axes(folder, "in_anglvel", self._scale)
            has_acceleration = self._acceleration_scale > 0.0
            along = self._read_axes(folder, "in_accel", self._acceleration_scale) if has_acceleration else None
            return Sample(rates, along, _temperature(folder))
        except OSError as error:
            raise DeviceLostError(
                f"{self._name}: {folder.name} went away ({error})", "load its driver again"
            ) from error
        except ValueError as error:
            raise UnreadableError(f"{folder.name} holds no number: {error}") from error

    def _read_axes(self, folder: Path, kind: str, scale: float = 1.0) -> Vector:
        """Three axes; a chip that lacks some has zero there."""
        files = [folder / f"{kind}_{letter}_raw" for letter in AXES]
        own = files[self._axis]
        x, y, z = (float(file.read_text()) * scale if file == own or file.exists() else 0.0 for file in files)
        return x, y, z

    def _stop(self) -> None:
        self._folder = None

    def _refused(self, folder: Path, error: OSError) -> DriverError:
        return device_error(f"{self._name}: {folder}", error, group="root", absent=CURE, busy="stop who reads it")


def _gyros(sysfs: Path) -> list[Path]:
    return sorted(folder for folder in sysfs.glob("iio:device*") if (folder / "in_anglvel_scale").exists())


def _text(file: Path) -> str:
    try:
        return file.read_text().strip()
    except OSError:
        return ""


def _temperature(folder: Path) -> float | None:
    """In °C; the files hold thousandths."""
    raw, offset, scale = (_text(folder / file) for file in TEMPERATURES)
    return (float(raw) + float(offset or 0.0)) * float(scale or 1.0) / 1000.0 if raw else None


class FakeIio:
    """The files of a gyro that lies still, turning at one hundredth of a radian a second."""

    def __init__(self, root: Path) -> None:
        self.clock = BootClock()
        self.settings = {"sysfs": str(root), "hz": 50.0}
        self._folder = root / "iio:device0"
        self.plug()

    def speak(self) -> None:
        """It always does."""
        (self._folder / "in_anglvel_z_raw").write_text("10\n")

    def garble(self) -> None:
        """A file that holds no number."""
        (self._folder / "in_anglvel_z_raw").write_text("\n")

    def plug(self) -> None:
        """Give the device back."""
        self._folder.mkdir()
        for file, text in {"name": "mpu6050", "in_anglvel_scale": "0.001", CLOCK_FILE: "realtime"}.items():
            (self._folder / file).write_text(text + "\n")
        for letter in AXES:
            (self._folder / f"in_anglvel_{letter}_raw").write_text("10\n")

    def unplug(self) -> None:
        """Take it away."""
        for file in self._folder.iterdir():
            file.unlink()
        self._folder.rmdir()
