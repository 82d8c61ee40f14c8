"""One sample read three ways: the registers, the kernel's IIO driver, and the registers that the kernel now owns."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from smbus2 import SMBus, i2c_msg

from kernel.guest.gyro import ADDRESS, SAMPLE, StubMpu6050

NOBODY_HOME = 0x6A


def run(accel: tuple[int, int, int], temperature: int, gyro: tuple[int, int, int]) -> dict[str, Any]:
    """Show the sample; read it from user space, then through the kernel's driver, then change it under the driver."""
    chip = StubMpu6050()
    chip.show(accel, temperature, gyro)
    seen: dict[str, Any] = {
        "block": read_block(chip.bus, ADDRESS),
        "errno without a chip": errno_of_block(chip.bus, NOBODY_HOME),
        "errno of i2c_rdwr": errno_of_transfer(chip.bus),
    }
    iio = chip.bind_kernel_driver()
    seen["iio"] = read_iio(iio)
    chip.show(accel, temperature, (-gyro[0], -gyro[1], -gyro[2]))
    seen["iio reversed"] = read_iio(iio)
    seen["errno while the kernel owns it"] = errno_of_block(chip.bus, ADDRESS)
    seen["clock"] = (iio / "current_timestamp_clock").read_text().strip()
    (iio / "current_timestamp_clock").write_text("monotonic")
    seen["clock set"] = (iio / "current_timestamp_clock").read_text().strip()
    return seen


def read_block(bus: int, address: int) -> list[int]:
    """Seven numbers in one transfer: acceleration, temperature, rates."""
    with SMBus(bus) as i2c:
        return list(struct.unpack(">7h", bytes(i2c.read_i2c_block_data(address, SAMPLE, 14))))


def errno_of_block(bus: int, address: int) -> int | None:
    """Of a read that is refused."""
    try:
        read_block(bus, address)
    except OSError as error:
        return error.errno
    return None


def errno_of_transfer(bus: int) -> int | None:
    """The stub knows SMBus only: libraries that send raw transfers cannot use it."""
    try:
        with SMBus(bus) as i2c:
            i2c.i2c_rdwr(i2c_msg.read(ADDRESS, 1))
    except OSError as error:
        return error.errno
    return None


def read_iio(folder: Path) -> dict[str, Any]:
    """Raw counts and scales, as the kernel prints them."""
    raw = {axis: int((folder / f"in_anglvel_{axis}_raw").read_text()) for axis in "xyz"}
    raw |= {f"accel {axis}": int((folder / f"in_accel_{axis}_raw").read_text()) for axis in "xyz"}
    return {
        **raw,
        "rad/s": float((folder / "in_anglvel_scale").read_text()),
        "name": (folder / "name").read_text().strip(),
    }
