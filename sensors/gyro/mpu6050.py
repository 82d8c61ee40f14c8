"""InvenSense MPU-6050 and its relatives on I2C, from user space (register map RM-MPU-6000A-00, revision 4.2).

One block of fourteen bytes a sample: read byte by byte, high and low halves of different samples meet and the rate
spikes. Accelerations are those of the chip's own axes.
"""

from __future__ import annotations

import errno
import math
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

from fusion import (
    BootClock,
    Clock,
    DeviceLostError,
    DriverError,
    Found,
    Needs,
    ProtocolError,
    SettingError,
)
from sensors.device_errors import device_error, missing_package
from sensors.gyro.sampling import Sample, SampledGyro, UnreadableError

WHO_AM_I, POWER, RATE_DIVIDER, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, FIRST_SAMPLE = (
    0x75,
    0x6B,
    0x19,
    0x1A,
    0x1B,
    0x1C,
    0x3B,
)
MODELS = {0x68: "MPU-6050", 0x70: "MPU-6500", 0x71: "MPU-9250"}
"""Models by WHO_AM_I of which the registers used here are the same."""
RANGES_DEG_S = (250, 500, 1000, 2000)
"""Full scales of the gyro, by FS_SEL; 131 steps to the degree a second at the first, half as many at each next."""
LOW_PASS_44_HZ = 3
CLOCK_OF_GYRO = 1
LENGTH = 14
BLOCK = struct.Struct(">7h")
STANDARD_GRAVITY = 9.80665
STEPS_PER_G = 16384.0
"""At the full scale of 2 g."""
BUSES = "dev/i2c-*"
CURE_BUS = "set dtparam=i2c_arm=on and load i2c-dev, and look at the wiring: `i2cdetect -y BUS` shows who answers"
CURE_BUSY = 'the kernel owns that address: use "gyro_iio", or unload its driver (rmmod inv_mpu6050_i2c)'


class Bus(Protocol):
    """The device: an I2C bus. smbus2's SMBus is the real one, `FakeMpu6050` the other."""

    def read_i2c_block_data(self, address: int, register: int, length: int) -> Sequence[int]:
        """Bytes from a register on."""

    def write_byte_data(self, address: int, register: int, value: int) -> None:
        """One byte into a register."""

    def close(self) -> None:
        """Let go."""


def parse(block: bytes, full_scale_deg_s: int) -> Sample:
    """A sample from its fourteen bytes; raises `UnreadableError` for the bytes of a bus that dropped out.

    >>> parse(bytes.fromhex("0000 0000 4000 0000 0000 0000 0083"), 250)
    Sample(rate_rad_s=(0.0, 0.0, 0.017453292519943295), acceleration_m_s2=(0.0, 0.0, 9.80665), temperature_c=36.53)
    """
    if len(block) != LENGTH or not block.strip(b"\xff") or not block.strip(b"\x00"):
        raise UnreadableError(f"{len(block)} bytes that no sample has: {block.hex()}")
    *acceleration, temperature, x, y, z = BLOCK.unpack(block)
    step = math.radians(1.0) / (131.0 * 250.0 / full_scale_deg_s)
    to_m_s2 = STANDARD_GRAVITY / STEPS_PER_G
    rates = (x * step, y * step, z * step)
    along = (acceleration[0] * to_m_s2, acceleration[1] * to_m_s2, acceleration[2] * to_m_s2)
    return Sample(rates, along, temperature / 340.0 + 36.53)


def _open_bus(number: int) -> Bus:
    """The bus as the system has it."""
    try:
        import smbus2
    except ImportError as error:
        raise missing_package("smbus2") from error
    bus: Any = smbus2.SMBus(number)
    return bus  # type: ignore[no-any-return]  # it has those three methods


class GyroMpu6050(SampledGyro):
    """An MPU-6050 at an address of an I2C bus."""

    summary: ClassVar[str] = "MPU-6050, MPU-6500 or MPU-9250 gyro on I2C"
    needs = Needs(groups=("i2c",), modules=("smbus2",))

    def __init__(
        self,
        name: str,
        clock: Clock,
        *,
        bus: int = 1,
        address: int = 0x68,
        axis: str = "+z",
        hz: float = 100.0,
        full_scale_deg_s: int = 250,
        device: Callable[[int], Bus] = _open_bus,
    ) -> None:
        """``device`` stands in for the bus."""
        super().__init__(name, clock, axis=axis, hz=hz)
        if full_scale_deg_s not in RANGES_DEG_S:
            scales = ", ".join(map(str, RANGES_DEG_S))
            raise SettingError(f"{name}: full_scale_deg_s = {full_scale_deg_s}", f"give one of {scales}")
        self._number, self._address, self._scale = bus, address, full_scale_deg_s
        self._open_device = device
        self._bus: Bus | None = None

    @classmethod
    def discover(cls) -> list[Found]:
        """The I2C buses; nobody on them is asked, since asking can upset other chips."""
        buses = sorted(Path("/").glob(BUSES))
        return [Found(str(bus), "I2C bus", MappingProxyType({"bus": int(bus.name[4:])})) for bus in buses]

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeMpu6050]:
        """A chip that lies still."""
        yield FakeMpu6050()

    def _start(self) -> tuple[str, dict[str, object]]:
        try:
            self._bus = self._open_device(self._number)
            identity = self._bus.read_i2c_block_data(self._address, WHO_AM_I, 1)[0]
            if identity not in MODELS:
                hint = f"this driver knows {', '.join(MODELS.values())}"
                raise ProtocolError(f"{self._where}: WHO_AM_I is {identity:#04x}", hint)
            for register, value in self._registers().items():
                self._bus.write_byte_data(self._address, register, value)
            self._check(self._bus)
        except OSError as error:
            raise self._refused(error) from error
        return MODELS[identity], {"bus": self._number, "address": self._address, "full_scale_deg_s": self._scale}

    def _registers(self) -> dict[int, int]:
        """The chip awake, sampling a thousand times a second behind a low pass of 44 Hz."""
        scale = RANGES_DEG_S.index(self._scale) << 3
        return {
            POWER: CLOCK_OF_GYRO,
            RATE_DIVIDER: 0,
            CONFIG: LOW_PASS_44_HZ,
            GYRO_CONFIG: scale,
            ACCEL_CONFIG: 0,
        }

    def _check(self, bus: Bus) -> None:
        """Raises `ProtocolError` where a setting did not stay."""
        for register, value in self._registers().items():
            found = bus.read_i2c_block_data(self._address, register, 1)[0]
            if found != value:
                raise ProtocolError(
                    f"{self._where}: register {register:#04x} holds {found:#04x} after {value:#04x} was written",
                    "look at its supply and wiring; another chip may answer at this address",
                )

    def _read(self) -> Sample:
        bus = self._bus
        if bus is None:
            raise DeviceLostError(f"{self._name} is not open", "open the driver first")
        try:
            return parse(bytes(bus.read_i2c_block_data(self._address, FIRST_SAMPLE, LENGTH)), self._scale)
        except OSError as error:
            raise DeviceLostError(f"{self._where} went away ({error})", "look at its wires") from error

    def _stop(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(OSError):
                bus.close()

    @property
    def _where(self) -> str:
        return f"{self._name}: address {self._address:#04x} of /dev/i2c-{self._number}"

    def _refused(self, error: OSError) -> DriverError:
        cure = CURE_BUS.replace("BUS", str(self._number))
        return device_error(self._where, error, group="i2c", absent=cure, busy=CURE_BUSY)


class FakeMpu6050:
    """A chip on a bus, register by register, and for the kit the hand that pulls its wires."""

    def __init__(self) -> None:
        self.clock = BootClock()
        self.settings = {"device": lambda _number: self, "hz": 50.0}
        self.block = bytes.fromhex("0000 0000 4000 0000 0000 0000 0083")
        """Content of the sample registers: one degree a second about z."""
        self._registers = {WHO_AM_I: 0x68}
        self._is_there = True
        self._garbled = 0

    def speak(self) -> None:
        """It always does."""

    def garble(self) -> None:
        """The bus drops out for one reading."""
        self._garbled = 1

    def unplug(self) -> None:
        """Pull the wires."""
        self._is_there = False

    def plug(self) -> None:
        """Put them back; the chip wakes up as it leaves the factory."""
        self._registers = {WHO_AM_I: 0x68}
        self._is_there = True

    def read_i2c_block_data(self, _address: int, register: int, length: int) -> Sequence[int]:
        """Bytes from a register on."""
        self._require()
        if register != FIRST_SAMPLE:
            return [self._registers.get(register, 0)]
        garbled, self._garbled = self._garbled, 0
        return list(b"\xff" * length if garbled else self.block)

    def write_byte_data(self, _address: int, register: int, value: int) -> None:
        """One byte into a register."""
        self._require()
        self._registers[register] = value

    def close(self) -> None:
        """Let go."""

    def _require(self) -> None:
        if not self._is_there:
            raise OSError(errno.EREMOTEIO, "Remote I/O error")
