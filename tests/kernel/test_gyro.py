"""A gyro made of registers, behind the kernel's real I2C and IIO."""

import errno

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
