"""The kit of drivers finds a driver out that breaks a promise: one spoilt on purpose for each."""

import sys
from dataclasses import replace

import pytest

from fusion.cli.main import main
from fusion.conformance.checks import Check, Outcome, verdict
from fusion.conformance.driver_promises import DRIVER_PROMISES
from fusion.driver import DeviceInfo, DriverSpec
from fusion.errors import DeviceLostError, NotPermittedError
from fusion.values import WheelTicks
from sensors.simulation.drivers import SimulatedEncoders as Good


class NoSummary(Good):
    summary = None


class LoudDiscovery(Good):
    @classmethod
    def discover(cls):
        raise OSError("no such bus")


class TakesAnything(Good):
    def __init__(self, name, clock, *, no_such_setting=0, **settings):
        super().__init__(name, clock, **settings)


class NoLeastRate(Good):
    def __init__(self, name, clock, **settings):
        super().__init__(name, clock, **settings)
        self.spec = DriverSpec((WheelTicks,), 1.0, 5.0)


class Nameless(Good):
    def open(self):
        super().open()
        return DeviceInfo("")


class OtherName(Good):
    def poll(self, timeout_s):
        return [
            replace(output, sensor="x") if isinstance(output, WheelTicks) else output
            for output in super().poll(timeout_s)
        ]


class Foretelling(Good):
    def poll(self, timeout_s):
        return [
            replace(s, time_ns=s.time_ns + 10**9) if isinstance(s, WheelTicks) else s for s in super().poll(timeout_s)
        ]


class Repeating(Good):
    def poll(self, timeout_s):
        return [replace(s, seq=7) if isinstance(s, WheelTicks) else s for s in super().poll(timeout_s)]


class Sleepy(Good):
    def poll(self, timeout_s):
        self._robot.clock.sleep(5.0)
        return super().poll(timeout_s)


class Swallowing(Good):
    def poll(self, timeout_s):
        self._robot.garbled.clear()
        return super().poll(timeout_s)


class Pretending(Good):
    """Goes on with nothing when its device is gone."""

    def poll(self, timeout_s):
        try:
            return super().poll(timeout_s)
        except DeviceLostError:
            return []


class Hopeless(Good):
    """Says of a device that is only unplugged that a person is needed."""

    def open(self):
        if not self._is_there():
            raise NotPermittedError("no", "never")
        return super().open()


class OnceOnly(Good):
    opened = False

    def open(self):
        if self.opened:
            raise DeviceLostError("used up", "none")
        self.opened = True
        return super().open()


class Touchy(Good):
    def close(self):
        if not self._is_open:
            raise ValueError("not open")
        super().close()


SPOILT = {
    "describes_itself": NoSummary,
    "discovers_quietly": LoudDiscovery,
    "refuses_settings": TakesAnything,
    "has_a_spec": NoLeastRate,
    "opens_and_reports_its_device": Nameless,
    "measures": OtherName,
    "stamps_honestly": Foretelling,
    "numbers_rise": Repeating,
    "waits_no_longer": Sleepy,
    "survives_garbage": Swallowing,
    "reports_loss": Pretending,
    "refuses_absence": Hopeless,
    "comes_back": OnceOnly,
    "closes_always": Touchy,
}


@pytest.mark.parametrize("promise", DRIVER_PROMISES, ids=lambda promise: promise.id)
def test_each_promise_finds_a_driver_that_breaks_it(promise):
    broken = verdict(Check(promise, SPOILT[promise.id]))
    assert broken.outcome is Outcome.BROKEN
    assert broken.detail


def test_promises_on_a_fake_device_are_skipped_for_a_driver_without_one():
    class Bare:
        summary = "bare"

    outcomes = {promise.id: verdict(Check(promise, Bare)).outcome for promise in DRIVER_PROMISES}
    assert outcomes["measures"] is Outcome.SKIPPED
    assert outcomes["discovers_quietly"] is Outcome.BROKEN


def test_the_command_checks_a_driver_by_name(capsys):
    assert main(["check", "--driver", "simulated_gyro"]) == 0
    assert "14 promises kept, 0 broken" in capsys.readouterr().out
    assert main(["check", "--driver", "simulated_gyros"]) == 1
    assert "did you mean 'simulated_gyro'" in capsys.readouterr().err


def test_driver_whose_package_is_missing_breaks_no_promise_and_is_reported_once(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "serialx", None)
    assert main(["check", "--driver", "uwb_qm33"]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("fusion check: the package serialx is missing; python3 -m pip install")
