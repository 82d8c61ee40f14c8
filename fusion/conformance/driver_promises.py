"""The conformance kit of drivers: the promises of every driver, each a small hunt for a counter-example.

Half of them need no device: a driver must behave where nothing is plugged in. The others play on the driver's own
`FakeDevice`; for a driver that ships none they are skipped. Ours and strangers' drivers are held against the same
list, by `fusion check --driver NAME` or, in a test, by `run_driver_checks`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any, Protocol, cast, runtime_checkable

from fusion.conformance.checks import Check, Verdict, verdict
from fusion.conformance.promise import Promise, promise, require
from fusion.driver import BootClock, DeviceInfo, Diagnostic, Driver, DriverOutput, DriverSpec, FakeDevice, Found, Level
from fusion.errors import ConformanceError, DeviceLostError, DriverError, SettingError
from fusion.plugins import SENSORS, load
from fusion.values import Truth, seconds

NAME = "sensor-under-test"
TRIES = 50
"""Polls after which the message of a device must have come out."""
POLL_S = 0.05
LATE_S = 2.0
"""Time that a poll may take longer than asked [s]: a whole Wi-Fi scan is never waited for in one."""


@runtime_checkable
class DriverWithFake(Protocol):
    """A driver that ships a stand-in of its device."""

    @classmethod
    def fake(cls) -> AbstractContextManager[FakeDevice]:
        """A fake device on which the driver plays."""


DRIVER_PROMISES: list[Promise] = []
_promise = partial(promise, DRIVER_PROMISES)
_on_fake = partial(promise, DRIVER_PROMISES, offers=DriverWithFake)


def run_driver_checks(name: str) -> list[Verdict]:
    """A verdict on every promise for the installed driver ``name``; raises `PluginError` for an unknown one, and
    `DependencyError` where a package that it needs, on its fake device too, is missing.
    """
    made = load(name, SENSORS)
    return [verdict(Check(one, made)) for one in DRIVER_PROMISES]


@contextmanager
def _playing(made: type[Any]) -> Iterator[tuple[Driver, FakeDevice]]:
    with made.fake() as device:
        driver = cast(Driver, made(NAME, device.clock, **device.settings))
        try:
            yield driver, device
        finally:
            driver.close()


def _listen(driver: Driver, until: Callable[[DriverOutput], bool]) -> list[DriverOutput]:
    """Output of the driver until some is as wanted; gives up after many polls."""
    outputs: list[DriverOutput] = []
    for _ in range(TRIES):
        outputs += driver.poll(POLL_S)
        if any(until(output) for output in outputs):
            break
    return outputs


def _is_measurement(output: DriverOutput) -> bool:
    return not isinstance(output, Diagnostic)


def _measured(output: Sequence[DriverOutput]) -> list[Any]:
    return [one for one in output if _is_measurement(one)]


@_promise("describes_itself", "a list of drivers must not need their hardware")
def _describes_itself(made: type[Any]) -> None:
    require(isinstance(getattr(made, "summary", None), str), "it has no one-line summary")
    for method in ("discover", "open", "poll", "close"):
        require(callable(getattr(made, method, None)), f"it has no method {method}")


@_promise("discovers_quietly", "looking for devices on any machine must end well")
def _discovers_quietly(made: type[Any]) -> None:
    devices = made.discover()
    require(isinstance(devices, list), f"discover answered {devices!r}, not a list")
    strangers = [one for one in devices if not isinstance(one, Found)]
    require(not strangers, f"discover found {strangers}, which are no Found")


@_promise("refuses_settings", "a misspelt setting must not be ignored")
def _refuses_settings(made: type[Any]) -> None:
    try:
        made(NAME, BootClock(), no_such_setting=1)
    except (SettingError, TypeError):
        return
    raise ConformanceError("it took a setting named 'no_such_setting'")


@_on_fake("has_a_spec", "the watchdog must know how long silence may last")
def _has_a_spec(made: type[Any]) -> None:
    with _playing(made) as (driver, _):
        spec = driver.spec
        require(isinstance(spec, DriverSpec), f"its spec is {spec!r}")
        require(spec.kinds, "its spec names no kinds of measurement")
        require(spec.nominal_hz >= spec.least_hz >= 0.0, f"nominal {spec.nominal_hz} Hz, least {spec.least_hz} Hz")


@_on_fake("opens_and_reports_its_device", "a log must state which device and which settings it came from")
def _opens_and_reports_its_device(made: type[Any]) -> None:
    with _playing(made) as (driver, _):
        info = driver.open()
        require(isinstance(info, DeviceInfo), f"open answered {info!r}, not a DeviceInfo")
        require(info.model, "open reports no model")


@_on_fake("measures", "what the device sends must come out, under the sensor's name and of the kinds of its spec")
def _measures(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.open()
        device.speak()
        outputs = _listen(driver, _is_measurement)
        require(_measured(outputs), f"the device spoke and no measurement came in {TRIES} polls: {outputs}")
        for output in outputs:
            name = NAME if isinstance(output, Truth) else output.sensor
            require(name == NAME, f"{output} goes by the name {name!r}, not {NAME!r}")
            require(isinstance(output, (*driver.spec.kinds, Diagnostic)), f"{output} is of no kind that its spec names")


@_on_fake("stamps_honestly", "a stamp is when it was true: never in the future, never before the device was opened")
def _stamps_honestly(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        opened_ns = device.clock.now_ns()
        driver.open()
        device.speak()
        for output in _measured(_listen(driver, _is_measurement)):
            now_ns = device.clock.now_ns()
            early_s = seconds(opened_ns - output.time_ns)
            require(output.time_ns <= now_ns, f"{output} is stamped {seconds(output.time_ns - now_ns)} s in the future")
            require(early_s <= 0.0, f"{output} is stamped {early_s} s before the device was opened")


@_on_fake("numbers_rise", "a gap in the numbers is how a lost message shows")
def _numbers_rise(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.open()
        outputs = []
        for _ in range(3):
            device.speak()
            outputs += _measured(_listen(driver, _is_measurement))
        for kind in {type(output) for output in outputs}:
            numbers = [getattr(output, "seq", output.time_ns) for output in outputs if type(output) is kind]
            require(numbers == sorted(set(numbers)), f"{kind.__name__} came with the numbers {numbers}")


@_on_fake("waits_no_longer", "a poll that blocks keeps the robot from stopping")
def _waits_no_longer(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.open()
        clocks = (device.clock, BootClock())
        before = [clock.now_ns() for clock in clocks]
        driver.poll(POLL_S)
        took_s = max(seconds(clock.now_ns() - at) for clock, at in zip(clocks, before, strict=True))
        require(took_s <= POLL_S + LATE_S, f"a poll of {POLL_S} s took {took_s:.2f} s")


@_on_fake("survives_garbage", "one bad line costs that line, and is reported")
def _survives_garbage(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.open()
        device.garble()
        outputs = _listen(driver, lambda output: isinstance(output, Diagnostic) and output.level is not Level.OK)
        require(
            any(isinstance(output, Diagnostic) for output in outputs),
            "the device sent nonsense and no diagnostic reports it",
        )
        device.speak()
        require(_measured(_listen(driver, _is_measurement)), "after nonsense no measurement came any more")


@_on_fake("reports_loss", "a device that is gone must not look like one that is silent")
def _reports_loss(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.open()
        device.speak()
        _listen(driver, _is_measurement)
        device.unplug()
        try:
            for _ in range(TRIES):
                driver.poll(POLL_S)
        except DeviceLostError as error:
            require(error.hint, "the error gives no hint")
            return
        raise ConformanceError(f"the device was unplugged and {TRIES} polls raised no DeviceLostError")


@_on_fake("refuses_absence", "a missing device is an error with a remedy, and leaves nothing half open")
def _refuses_absence(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        device.unplug()
        try:
            driver.open()
        except DriverError as error:
            require(error.hint, "the error gives no hint")
            require(
                error.passes, f"{type(error).__name__} states that it cannot pass, but the device may be plugged in"
            )
            return
        raise ConformanceError("it opened a device that is not there")


@_on_fake("comes_back", "a cable is pulled and put back: the same driver must go on")
def _comes_back(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.open()
        device.unplug()
        driver.close()
        device.plug()
        driver.open()
        device.speak()
        require(_measured(_listen(driver, _is_measurement)), "opened again after a loss, it measures nothing")


@_on_fake("closes_always", "whatever state it is in, letting go must work")
def _closes_always(made: type[Any]) -> None:
    with _playing(made) as (driver, device):
        driver.close()
        driver.open()
        driver.close()
        driver.close()
        driver.open()
        device.unplug()
        driver.close()
