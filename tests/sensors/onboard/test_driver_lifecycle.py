"""The lifecycle of a driver reopens it whatever happens, and reports its loss and its return once each."""

import itertools

import pytest

from fusion.driver import DeviceInfo, Diagnostic, DriverSpec, Level, VirtualClock
from fusion.errors import BusyError, DeviceLostError, NotFoundError, NotPermittedError
from fusion.values import Gyro, nanoseconds
from sensors.onboard.driver_lifecycle import LONGEST_WAIT_S, DriverLifecycle, State


class Scripted:
    """A driver on a virtual clock that does what its script says, poll by poll: a number of messages, or an error."""

    summary = "scripted"

    def __init__(self, clock, script=(), opening=(), least_hz=1.0):
        self.spec = DriverSpec((Gyro,), 10.0, least_hz)
        self.clock, self.script, self.opening = clock, list(script), list(opening)
        self.opened = self.closed = 0

    @classmethod
    def discover(cls):
        return []

    def open(self):
        self.opened += 1
        if self.opening and (error := self.opening.pop(0)) is not None:
            raise error
        return DeviceInfo("scripted")

    def poll(self, timeout_s):
        self.clock.sleep(timeout_s)
        said = self.script.pop(0) if self.script else 0
        if isinstance(said, Exception):
            raise said
        return [Gyro(self.clock.now_ns(), "gyro", i, 0.0) for i in range(said)]

    def close(self):
        self.closed += 1


def kept(script=(), opening=(), least_hz=1.0, **options):
    clock = VirtualClock()
    driver = Scripted(clock, script, opening, least_hz)
    return DriverLifecycle("gyro", driver, clock, **options), driver, clock


def run(lifecycle, turns):
    return [one for _ in range(turns) for one in lifecycle.step(0.1)]


def diagnostics(received):
    return [one.output for one in received if isinstance(one.output, Diagnostic)]


def test_what_a_driver_says_comes_out_with_its_time_of_arrival():
    lifecycle, _, clock = kept([2])
    received = run(lifecycle, 2)
    assert [one.output.seq for one in received] == [0, 1]
    assert {one.received_ns for one in received} == {clock.now_ns()}
    assert lifecycle.state is State.RUNNING


def test_a_device_that_is_missing_at_the_start_is_waited_for_and_told_once_each_way():
    gone = NotFoundError("no device", "plug it in")
    lifecycle, driver, _ = kept([1, 1], [gone] * 5 + [None])
    said = diagnostics(run(lifecycle, 400))
    assert [diagnostic.level for diagnostic in said] == [Level.WARN, Level.OK, Level.WARN]  # away, back, silent
    assert driver.opened >= 6
    assert lifecycle.losses == 2


def test_a_device_that_is_lost_is_let_go_of_before_it_is_opened_again():
    lifecycle, driver, _ = kept([1, DeviceLostError("unplugged", "plug it in"), 1])
    run(lifecycle, 10)
    assert (driver.opened, driver.closed) == (2, 1)


def test_waits_grow_to_their_limit_and_never_end():
    lifecycle, driver, clock = kept((), [BusyError("busy", "stop the other")] * 1000)
    tries = []
    while clock.now_ns() < nanoseconds(3600.0):
        before = driver.opened
        lifecycle.step(0.1)
        if driver.opened > before:
            tries.append(clock.now_ns() / 1e9)
    gaps = [later - earlier for earlier, later in itertools.pairwise(tries)]
    assert gaps[0] <= 0.3
    assert min(gaps[10:]) >= LONGEST_WAIT_S / 2
    assert max(gaps) <= LONGEST_WAIT_S + 0.2
    assert len(tries) > 3600 / LONGEST_WAIT_S


def test_a_device_that_was_healthy_for_long_is_tried_again_at_once():
    lifecycle, _, clock = kept([1] * 700 + [DeviceLostError("gone", "plug it in")], [None, NotFoundError("no", "plug")])
    lifecycle.step(0.1)
    while lifecycle.state is State.RUNNING:
        lifecycle.step(0.1)
    lost_ns = clock.now_ns()
    lifecycle.step(0.5)
    assert clock.now_ns() - lost_ns <= nanoseconds(0.2)


def test_silence_counts_as_loss_only_where_it_is_too_long():
    slow, _, clock = kept([1, *[0] * 55, 1], least_hz=0.5)
    assert not diagnostics(run(slow, 58))
    assert clock.now_ns() > nanoseconds(5.5)
    silent, driver, _ = kept([1], least_hz=10.0)
    said = diagnostics(run(silent, 14))
    assert "has been silent for" in said[0].text
    assert driver.closed == 1


def test_a_sensor_that_speaks_only_when_something_happens_may_be_silent_for_ever():
    lifecycle, _, _ = kept((), least_hz=0.0)
    assert not diagnostics(run(lifecycle, 1000))


def test_what_needs_a_person_is_not_tried_again():
    lifecycle, driver, _ = kept((), [NotPermittedError("may not", "join the group i2c")])
    said = diagnostics(run(lifecycle, 100))
    assert driver.opened == 1
    assert lifecycle.state is State.FAILED
    assert "i2c" in said[0].text


def test_failing_fast_ends_at_the_first_loss():
    lifecycle, driver, _ = kept([DeviceLostError("gone", "plug it in")], fail_fast=True)
    run(lifecycle, 50)
    assert lifecycle.state is State.FAILED
    assert driver.opened == 1


def test_a_fault_of_a_driver_is_told_as_its_own_and_costs_only_itself():
    lifecycle, driver, _ = kept([ZeroDivisionError("oops"), 1])
    said = diagnostics(run(lifecycle, 20))
    assert "ZeroDivisionError" in said[0].text
    assert driver.opened == 2


@pytest.mark.parametrize("turns", [0, 1, 5])
def test_a_keeper_can_be_closed_in_any_state(turns):
    lifecycle, driver, _ = kept([1, DeviceLostError("gone", "plug it in")])
    run(lifecycle, turns)
    lifecycle.close()
    lifecycle.close()
    assert lifecycle.state is State.CLOSED
    assert driver.closed >= 2
