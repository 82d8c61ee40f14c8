"""An MPU-6050 made of registers: i2c-stub stands for the chip, the kernel's own driver or user space reads it."""

from __future__ import annotations

import struct
from pathlib import Path

from smbus2 import SMBus

from kernel.guest.system import load, wait_until

ADDRESS, WHO_AM_I, SAMPLE = 0x68, 0x75, 0x3B
I2C, IIO = Path("/sys/bus/i2c/devices"), Path("/sys/bus/iio/devices/iio:device0")


class StubMpu6050:
    """Registers that a test writes: `bus` is the I2C bus number; it keeps writing while the kernel owns the chip."""

    def __init__(self) -> None:
        load("i2c-dev")
        load("i2c-stub", f"chip_addr={ADDRESS:#x}")
        (folder,) = (path.parent for path in I2C.glob("i2c-*/name") if path.read_text().startswith("SMBus stub"))
        self.bus = int(folder.name.removeprefix("i2c-"))
        self._folder = folder
        wait_until(lambda: Path(f"/dev/i2c-{self.bus}").exists(), "the I2C bus")
        self._registers = SMBus(self.bus, force=True)
        self._registers.write_byte_data(ADDRESS, WHO_AM_I, 0x68, force=True)

    def show(self, accel: tuple[int, int, int], temperature: int, gyro: tuple[int, int, int]) -> None:
        """Put one sample into the registers, raw counts, big-endian as the chip has them."""
        sample = struct.pack(">7h", *accel, temperature, *gyro)
        self._registers.write_i2c_block_data(ADDRESS, SAMPLE, list(sample), force=True)

    def bind_kernel_driver(self) -> Path:
        """Give the chip to the kernel's IIO driver; its folder in sysfs."""
        load("inv-mpu6050-i2c")
        (self._folder / "new_device").write_text(f"mpu6050 {ADDRESS:#x}")
        wait_until((IIO / "in_anglvel_z_raw").exists, "the IIO device")
        return IIO

    def unbind_kernel_driver(self) -> None:
        """Take the chip from the kernel again."""
        (self._folder / "delete_device").write_text(f"{ADDRESS:#x}")
