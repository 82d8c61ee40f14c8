"""Gyros: every byte in its place, the axis that points up, a pace that skips what it missed."""

import errno
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion import (
    BusyError,
    DeviceLostError,
    Diagnostic,
    Gyro,
    NotFoundError,
    NotPermittedError,
    ProtocolError,
    SettingError,
    VirtualClock,
)
from sensors.gyro import mpu6050 as gyro_mpu6050
from sensors.gyro.iio import FakeIio, GyroIio
from sensors.gyro.mpu6050 import FakeMpu6050, GyroMpu6050, parse
from sensors.gyro.sampling import UnreadableError


def chip(**settings):
    device, clock = FakeMpu6050(), VirtualClock()
    return GyroMpu6050("gyro", clock, **{**device.settings, **settings}), device, clock


def samples(driver, count):
    said = []
    while sum(isinstance(one, Gyro) for one in said) < count:
        said += driver.poll(0.5)
    return [one for one in said if isinstance(one, Gyro)]


@given(st.tuples(*[st.integers(-32768, 32767)] * 7), st.sampled_from([250, 500, 1000, 2000]))
def test_a_block_holds_seven_numbers_high_byte_first(words, scale):
    block = b"".join(word.to_bytes(2, "big", signed=True) for word in words)
    if len(set(block)) == 1 and block[0] in (0x00, 0xFF):
        return
    sample = parse(block, scale)
    assert sample.rate_rad_s == pytest.approx([math.radians(word / (131.0 * 250.0 / scale)) for word in words[4:]])
    assert sample.acceleration_m_s2 == pytest.approx([9.80665 * word / 16384.0 for word in words[:3]])
    assert sample.temperature_c == pytest.approx(words[3] / 340.0 + 36.53)


@given(st.binary(max_size=20))
def test_no_bytes_make_the_parser_fail(block):
    try:
        parse(block, 250)
    except UnreadableError:
        assert len(block) != 14 or len(set(block)) == 1


@pytest.mark.parametrize(("axis", "sign"), [("+z", 1.0), ("-z", -1.0)])
def test_a_left_turn_is_positive_whichever_way_the_chip_lies(axis, sign):
    driver, _, _ = chip(axis=axis)
    driver.open()
    (first,) = samples(driver, 1)
    assert first.rate_rad_s == pytest.approx(sign * math.radians(1.0))
    assert first.acceleration_m_s2 == pytest.approx((0.0, 0.0, 9.80665))


def test_samples_fall_due_at_whole_periods_and_missed_ones_are_told():
    driver, _, clock = chip(hz=50.0)
    driver.open()
    assert [one.time_ns for one in samples(driver, 5)] == [i * 20_000_000 for i in range(5)]
    clock.sleep(1.0)
    late, after = samples(driver, 2)
    assert late.time_ns == 1_080_000_000
    assert after.time_ns == 1_100_000_000
    clock.sleep(10.0)
    said = [one for _ in range(3) for one in driver.poll(0.1) if isinstance(one, Diagnostic)]
    assert int(dict(said[0].values)["samples missed"]) == pytest.approx(550, abs=3)
    assert dict(said[0].values)["temperature_c"] == "36.53"


def test_the_settings_are_written_read_back_and_told():
    driver, device, _ = chip(full_scale_deg_s=500)
    info = driver.open()
    assert (info.model, info.settings["full_scale_deg_s"], info.settings["axis"]) == ("MPU-6050", 500, "+z")
    assert device._registers[gyro_mpu6050.GYRO_CONFIG] == 0x08
    (first,) = samples(driver, 1)
    assert first.rate_rad_s == pytest.approx(math.radians(2.0))


def test_a_setting_that_does_not_stay_and_a_stranger_on_the_bus_are_told(monkeypatch):
    driver, device, _ = chip()
    monkeypatch.setattr(device, "write_byte_data", lambda *_: None)
    with pytest.raises(ProtocolError, match="holds 0x00 after 0x01"):
        driver.open()
    device._registers[gyro_mpu6050.WHO_AM_I] = 0x42
    with pytest.raises(ProtocolError, match="WHO_AM_I is 0x42"):
        driver.open()


@pytest.mark.parametrize(
    ("number", "kind", "told"),
    [
        (errno.EBUSY, BusyError, "gyro_iio"),
        (errno.EREMOTEIO, NotFoundError, "i2cdetect -y 1"),
        (errno.ENODEV, NotFoundError, "i2cdetect"),
        (errno.ENOENT, NotFoundError, "i2c_arm"),
        (errno.EACCES, NotPermittedError, "usermod -aG i2c"),
        (errno.EIO, DeviceLostError, "cable"),
    ],
)
def test_every_refusal_of_the_bus_has_its_remedy(number, kind, told):
    def refuse(_number):
        raise OSError(number, "refused")

    driver, _, _ = chip(device=refuse)
    with pytest.raises(kind, match=told):
        driver.open()


@pytest.mark.parametrize(
    "settings", [{"axis": "z"}, {"axis": "+w"}, {"hz": 0.0}, {"hz": 5000.0}, {"full_scale_deg_s": 300}]
)
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(SettingError):
        chip(**settings)


def test_the_kernels_gyro_is_found_by_name_and_told_in_its_own_scale(tmp_path):
    device = FakeIio(tmp_path)
    for file, text in {"in_temp_raw": "1000", "in_temp_offset": "12420", "in_temp_scale": "2.941176"}.items():
        (tmp_path / "iio:device0" / file).write_text(text + "\n")
    driver = GyroIio("gyro", VirtualClock(), sysfs=str(tmp_path), device="mpu6050")
    info = driver.open()
    assert (info.model, info.settings["scale"]) == ("mpu6050", 0.001)
    assert (tmp_path / "iio:device0" / "current_timestamp_clock").read_text() == "monotonic"
    rate, diagnostic = driver.poll(0.1)
    assert rate.rate_rad_s == pytest.approx(0.01)
    assert dict(diagnostic.values)["temperature_c"] == "39.47"
    with pytest.raises(NotFoundError, match=r"no gyro 'mpu' .*mpu6050 \(iio:device0\)"):
        GyroIio("gyro", VirtualClock(), **device.settings, device="mpu").open()
