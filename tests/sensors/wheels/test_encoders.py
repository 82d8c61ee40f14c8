"""Counts are the kernel's: a program that is held up loses times and no distance, and unplugging loses nothing."""

import errno
import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion import (
    BootClock,
    BusyError,
    DeviceLostError,
    Diagnostic,
    NotPermittedError,
    SettingError,
    VirtualClock,
    WheelTicks,
)
from fusion.values import seconds
from sensors.wheels.encoders import Encoders
from sensors.wheels.fake_lines import FakeLines
from sensors.wheels.gpio_lines import BUFFER, Edge


@pytest.fixture
def wheels():
    with Encoders.fake() as device:
        driver = Encoders("wheels", device.clock, **device.settings)
        driver.open()
        yield driver, device
        driver.close()


def report(driver):
    """What is said with the next counts."""
    said = []
    while not any(isinstance(one, WheelTicks) for one in said):
        said += driver.poll(0.2)
    return said


def counts(driver):
    return report(driver)[-1].counts


def test_counts_are_the_numbers_of_the_last_edges(wheels):
    driver, device = wheels
    assert counts(driver) == (0, 0)
    device.turn(5)
    assert counts(driver) == (5, 5)
    device._numbers[17] += 1
    device._edges.append(Edge(17, device._numbers[17]))
    assert counts(driver) == (6, 5)


def test_wheels_that_stand_are_told_of_too(wheels):
    driver, _ = wheels
    assert [counts(driver) for _ in range(3)] == [(0, 0)] * 3


def test_edges_that_nobody_read_count_all_the_same_and_are_told(wheels):
    driver, device = wheels
    report(driver)
    device.turn(1550)
    diagnostic, ticks = report(driver)
    assert ticks.counts == (1550, 1550)
    assert dict(diagnostic.values)["edges"] == str(2 * 1550 - BUFFER)


def test_a_line_that_chatters_without_end_does_not_hold_up_the_report(wheels, monkeypatch):
    driver, device = wheels
    asked = []

    def chatter(_):
        asked.append(device.turn(1))
        assert len(asked) < 1_000_000, "the driver goes on reading for ever"
        return True

    monkeypatch.setattr(device, "wait", chatter)
    assert counts(driver)[0] > 0


def test_counting_goes_on_after_an_unplugged_chip(wheels):
    driver, device = wheels
    device.turn(7)
    report(driver)
    device.unplug()
    with pytest.raises(DeviceLostError, match="plug it in again"):
        report(driver)
    driver.close()
    device.plug()
    driver.open()
    device.turn(2)
    assert counts(driver) == (9, 9)


def test_a_stamp_lies_a_debouncing_time_before_its_report():
    device = FakeLines()
    driver = Encoders("wheels", device.clock, **device.settings, debounce_s=0.05)
    driver.open()
    report(driver)
    report(driver)
    ticks = report(driver)[-1]
    assert device.clock.now_ns() - ticks.time_ns >= 50_000_000


class HeldUp(FakeLines):
    """Wheels that roll at a steady 50 ticks a second past a program that is held up, for ``holds`` [s], as it waits."""

    def __init__(self, holds):
        super().__init__()
        self.clock = VirtualClock()
        self._holds = iter(holds)
        self._turned = 0

    def wait(self, timeout_s):
        self.clock.sleep(timeout_s)
        self._roll()
        self.clock.sleep(next(self._holds, 0.0))
        return True

    def read(self):
        self._roll()
        edges = super().read()
        self.clock.sleep(next(self._holds, 0.0))
        return edges

    def _roll(self):
        due = self.clock.now_ns() * 50 // 1_000_000_000
        self.turn(due - self._turned)
        self._turned = due


@given(st.lists(st.sampled_from([0.0, 0.0, 0.001, 0.03, 0.09, 0.2]), max_size=40))
def test_a_program_that_is_held_up_reports_no_speed_that_was_not_driven(holds):
    """Ten reports a second; within a tick and what turned between the two sides of one reading, counts fit stamps."""
    device = HeldUp(holds)
    driver = Encoders("wheels", device.clock, lines=(17,), hz=10.0, debounce_s=0.0, device=lambda: device)
    driver.open()
    reports = [report(driver)[-1] for _ in range(10)]
    for before, now in itertools.pairwise(reports):
        assert seconds(now.time_ns - before.time_ns) >= 0.05
    for one in reports:
        assert abs(one.counts[0] - 50.0 * seconds(one.time_ns)) <= 1.0 + 50.0 * max([0.0, *holds])


@pytest.mark.parametrize(
    ("number", "kind", "told"),
    [
        (errno.EBUSY, BusyError, "gpioinfo"),
        (errno.EACCES, NotPermittedError, "usermod -aG gpio"),
        (errno.EINVAL, SettingError, "no such lines"),
        (errno.EIO, DeviceLostError, "/dev/fake"),
    ],
)
def test_every_refusal_has_its_remedy(number, kind, told, monkeypatch):
    device = FakeLines()

    def refuse(*_):
        raise OSError(number, "refused")

    monkeypatch.setattr(device, "open", refuse)
    with pytest.raises(kind, match=told):
        Encoders("wheels", BootClock(), **device.settings).open()


@pytest.mark.parametrize(
    "settings", [{"lines": ()}, {"lines": (1, 1)}, {"lines": (-1,)}, {"hz": 0.0}, {"debounce_s": 2.0}]
)
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(SettingError):
        Encoders("wheels", BootClock(), **{"lines": (17, 27), **settings})


def test_a_diagnostic_is_no_measurement(wheels):
    driver, device = wheels
    device.garble()
    assert any(isinstance(one, Diagnostic) for one in report(driver))
