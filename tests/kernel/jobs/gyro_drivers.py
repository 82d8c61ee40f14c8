"""The two drivers of a gyro on one chip: its registers, the kernel's driver on top, and which of them owns it."""

from __future__ import annotations

from typing import Any

from fusion import BootClock, DriverError, Gyro
from kernel.guest.gyro import StubMpu6050
from sensors.gyro.iio import GyroIio
from sensors.gyro.mpu6050 import GyroMpu6050
from sensors.gyro.sampling import SampledGyro

Counts = tuple[int, int, int]


def run(accel: Counts, gyro: Counts) -> dict[str, Any]:
    """A sample and its reverse, first through the registers, then through the kernel, which comes and goes."""
    chip, clock = StubMpu6050(), BootClock()
    by_registers = GyroMpu6050("gyro", clock, bus=chip.bus, hz=20.0)
    by_kernel = GyroIio("gyro", clock, device="mpu6050", hz=20.0)
    seen: dict[str, Any] = {
        "nobody there": attempt(GyroMpu6050("gyro", clock, bus=chip.bus, address=0x69)),
        "no bus": attempt(GyroMpu6050("gyro", clock, bus=9)),
        "no kernel driver": attempt(by_kernel),
        "registers": attempt(by_registers),
        "rates": both_ways(chip, by_registers, accel, gyro),
    }
    iio = chip.bind_kernel_driver()
    seen["open before the kernel's"] = next_sample(by_registers).rate_rad_s
    seen["owned by the kernel"] = attempt(by_registers)
    seen["found"] = [found.about for found in GyroIio.discover()]
    seen["kernel"] = attempt(by_kernel)
    seen["kernel's clock"] = (iio / "current_timestamp_clock").read_text().strip()
    seen["kernel's rates"] = both_ways(chip, by_kernel, accel, gyro)
    chip.unbind_kernel_driver()
    seen["lost by the kernel"] = first_error(by_kernel)
    seen["registers again"] = attempt(by_registers)
    return seen


def attempt(driver: SampledGyro) -> list[str]:
    """The model of an opened chip, or the kind and the words of the error."""
    try:
        return [driver.open().model]
    except DriverError as error:
        return [type(error).__name__, str(error)]


def both_ways(chip: StubMpu6050, driver: SampledGyro, accel: Counts, gyro: Counts) -> list[Any]:
    """Turn rate and accelerations of the sample, and of one that turns the other way."""
    heard = []
    for sign in (1, -1):
        chip.show(accel, -1500, (sign * gyro[0], sign * gyro[1], sign * gyro[2]))
        sample = next_sample(driver)
        heard.append([sample.rate_rad_s, sample.acceleration_m_s2])
    return heard


def next_sample(driver: SampledGyro) -> Gyro:
    """The next one; its reading begins after this call."""
    while True:
        for said in driver.poll(1.0):
            if isinstance(said, Gyro):
                return said


def first_error(driver: SampledGyro) -> list[str]:
    """The kind and the words of what ends reading."""
    try:
        while True:
            driver.poll(1.0)
    except DriverError as error:
        return [type(error).__name__, str(error)]
