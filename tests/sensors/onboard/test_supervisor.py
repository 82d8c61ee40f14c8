"""Many sensors at once: none holds up another, what is dropped is counted, what is stale is not shown as fresh."""

import threading

import pytest

from fusion.driver import BootClock, DeviceInfo, Diagnostic, DriverSpec, Level, VirtualClock
from fusion.errors import DeviceLostError, NotFoundError
from fusion.values import Gyro
from sensors.onboard.driver_lifecycle import DriverLifecycle, Received, State
from sensors.onboard.supervisor import BoundedQueue, Supervisor

TENTH_NS = 100_000_000


class Counter:
    """A driver that says so many messages, then waits until it is let go."""

    summary = "counts"
    spec = DriverSpec((Gyro,), 10.0, 0.0)

    def __init__(self, name, count):
        self.name, self.left, self.seq = name, count, 0
        self.over = threading.Event()

    @classmethod
    def discover(cls):
        return []

    def open(self):
        return DeviceInfo("counter")

    def poll(self, timeout_s):
        if not self.left:
            self.over.wait(timeout_s)
            return []
        self.left, self.seq = self.left - 1, self.seq + 1
        return [Gyro(BootClock().now_ns(), self.name, self.seq, 0.0)]

    def close(self):
        pass


class Stuck(Counter):
    """A driver whose device holds it up in its first poll."""

    def poll(self, timeout_s):
        self.over.wait()
        return []


def supervised(*drivers, **options):
    clock = BootClock()
    return Supervisor([DriverLifecycle(driver.name, driver, clock) for driver in drivers], clock, **options)


def taken(supervisor, count):
    received = []
    while len(received) < count:
        received += supervisor.take(1.0)
    return received


def test_what_all_sensors_say_comes_out_in_the_order_of_its_arrival():
    with supervised(Counter("a", 50), Counter("b", 30)) as supervisor:
        received = taken(supervisor, 80)
    for name, count in (("a", 50), ("b", 30)):
        assert [one.output.seq for one in received if one.output.sensor == name] == list(range(1, count + 1))


def test_a_sensor_that_hangs_holds_up_no_other():
    stuck = Stuck("stuck", 0)
    with supervised(stuck, Counter("b", 30)) as supervisor:
        assert len(taken(supervisor, 30)) == 30
        stuck.over.set()


def test_a_full_queue_drops_its_oldest_and_counts():
    queue = BoundedQueue(capacity=3)
    queue.put([Received(i, Gyro(i, "g", i, 0.0)) for i in range(5)])
    assert [one.received_ns for one in queue.take()] == [2, 3, 4]
    assert (queue.messages, queue.dropped) == (5, 2)
    assert queue.take() == []


def test_diagnostics_are_no_measurements():
    queue = BoundedQueue()
    queue.put([Received(1, Diagnostic(1, "g", Level.WARN, "gone"))])
    assert (queue.messages, queue.latest) == (0, None)


def test_a_stale_value_is_refused_and_says_how_old_it_is():
    clock = VirtualClock()
    supervisor = Supervisor([DriverLifecycle("g", Counter("g", 0), clock)], clock)
    with pytest.raises(DeviceLostError, match="nothing yet"):
        supervisor.latest("g", 1.0)
    supervisor._queues["g"].put([Received(0, Gyro(0, "g", 1, 0.5))])
    assert supervisor.latest("g", 1.0).rate_rad_s == 0.5
    clock.sleep(1.5)
    with pytest.raises(DeviceLostError, match=r"1\.50 s old"):
        supervisor.latest("g", 1.0)
    with pytest.raises(NotFoundError, match="did you mean 'g'"):
        supervisor.latest("gg", 1.0)


def test_the_status_tells_rate_age_and_whether_a_device_holds_its_driver_up():
    clock = VirtualClock()
    lifecycle = DriverLifecycle("g", Counter("g", 0), clock)
    supervisor = Supervisor([lifecycle], clock)
    lifecycle.step(0.1)
    supervisor._queues["g"].put([Received(i * TENTH_NS, Gyro(i * TENTH_NS, "g", i, 0.0)) for i in range(5)])
    clock.sleep(1.0)
    status = supervisor.statuses()[0]
    assert (status.state, status.messages, status.age_s) == (State.RUNNING, 5, 0.6)
    assert status.rate_hz == pytest.approx(10.0)
    clock.sleep(30.0)
    assert supervisor.statuses()[0].state is State.STALLED


def test_old_news_that_comes_now_is_old_and_a_clock_that_is_ahead_makes_nothing_fresher():
    clock = VirtualClock(20 * TENTH_NS)
    supervisor = Supervisor([DriverLifecycle("g", Counter("g", 0), clock)], clock)
    for stamp_ns, age_s in ((5 * TENTH_NS, 1.5), (90 * TENTH_NS, 0.0), (TENTH_NS, 0.0)):
        supervisor._queues["g"].put([Received(20 * TENTH_NS, Gyro(stamp_ns, "g", 1, 0.5))])
        assert supervisor.statuses()[0].age_s == age_s
    assert supervisor.latest("g", 0.1).time_ns == 90 * TENTH_NS


def test_arrivals_never_run_backwards_from_one_batch_to_the_next():
    clock = VirtualClock()
    supervisor = Supervisor([DriverLifecycle(name, Counter(name, 0), clock) for name in "ab"], clock)
    supervisor._queues["a"].put([Received(7, Gyro(7, "a", 1, 0.0))])
    supervisor._news.set()
    assert [one.received_ns for one in supervisor.take(0.0)] == [7]
    supervisor._queues["b"].put([Received(5, Gyro(5, "b", 1, 0.0)), Received(9, Gyro(9, "b", 2, 0.0))])
    assert [(one.received_ns, one.output.seq) for one in supervisor.take(0.0)] == [(7, 1), (9, 2)]
