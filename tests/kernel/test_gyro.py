"""A gyro made of registers, behind the kernel's real I2C and IIO."""

import errno
import math

import pytest

pytestmark = pytest.mark.kernel

ACCEL, TEMPERATURE, GYRO = (100, -200, 16384), -1500, (11, -22, 258)


def test_a_sample_is_the_same_through_registers_and_through_the_kernels_driver(run_job):
    seen = run_job("gyro", accel=ACCEL, temperature=TEMPERATURE, gyro=GYRO).answer
    assert seen["block"] == [*ACCEL, TEMPERATURE, *GYRO]
    accel = {f"accel {axis}": raw for axis, raw in zip("xyz", ACCEL, strict=True)}
    scale = {"rad/s": 0.001064724, "name": "mpu6050"}
    assert seen["iio"] == {**dict(zip("xyz", GYRO, strict=True)), **accel, **scale}
    assert seen["iio reversed"] == {"x": -11, "y": 22, "z": -258, **accel, **scale}
    assert (seen["clock"], seen["clock set"]) == ("realtime", "monotonic")
    assert seen["errno while the kernel owns it"] == errno.EBUSY
    assert seen["errno without a chip"] == errno.ENODEV
    assert seen["errno of i2c_rdwr"] == errno.EOPNOTSUPP


def test_both_drivers_read_the_chip_and_say_who_owns_it(run_job):
    """By the data sheet: 131 steps to a degree a second and 16384 to g; by the kernel: the scales of its files."""
    seen = run_job("gyro_drivers", accel=ACCEL, gyro=GYRO).answer
    rate, along = math.radians(GYRO[2] / 131.0), [raw / 16384.0 * 9.80665 for raw in ACCEL]
    assert seen["rates"] == [[pytest.approx(rate), pytest.approx(along)], [pytest.approx(-rate), pytest.approx(along)]]
    rate, along = GYRO[2] * 0.001064724, [raw * 0.000598 for raw in ACCEL]
    assert seen["kernel's rates"] == [
        [pytest.approx(rate), pytest.approx(along)],
        [pytest.approx(-rate), pytest.approx(along)],
    ]
    assert seen["registers"] == seen["registers again"] == ["MPU-6050"]
    assert seen["kernel"] == seen["found"] == ["mpu6050"]
    assert seen["kernel's clock"] == "monotonic"
    assert seen["open before the kernel's"] == pytest.approx(-math.radians(GYRO[2] / 131.0))
    for what in ("nobody there", "no bus", "no kernel driver"):
        assert seen[what][0] == "NotFoundError", what
    kind, words = seen["owned by the kernel"]
    assert kind == "BusyError"
    assert "gyro_iio" in words
    assert seen["lost by the kernel"][0] == "DeviceLostError"
