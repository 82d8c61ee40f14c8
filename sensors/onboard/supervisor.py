"""All sensors of a robot at once: a thread and a bounded queue for each, so that none can hold up another.

A slow reader loses the oldest messages, and the loss is counted. A value is handed out with its age or not at all: what
is stale is never shown as fresh.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from types import TracebackType
from typing import NamedTuple

from fusion.driver import Clock, Diagnostic, DriverOutput
from fusion.errors import DeviceLostError, NotFoundError, did_you_mean
from fusion.values import nanoseconds, seconds
from sensors.onboard.driver_lifecycle import DriverLifecycle, Received, State

CAPACITY = 4096
"""Messages a queue holds: twenty seconds of a gyro at 200 Hz."""
POLL_S = 0.1
"""Longest time a driver is asked to wait for news, hence the delay until it notices that it should stop."""
HUNG_S = 15.0
"""A driver that did not come back for so long is held up by its device; the slowest scan ends within twelve."""
RATE_SPAN = 20
"""Messages over which a rate is computed."""


class Status(NamedTuple):
    """Status of a sensor. ``rate_hz`` and ``age_s``, that of its freshest measurement, are None before there is one."""

    name: str
    state: State
    rate_hz: float | None
    age_s: float | None
    messages: int
    dropped: int
    losses: int
    error: str

    @property
    def record(self) -> dict[str, object]:
        """The same as values that JSON knows."""
        return self._asdict() | {"state": self.state.value}


def true_ns(received: Received) -> int:
    """Time at which it was true [ns]: never after it was received, for a clock that is ahead makes nothing fresher."""
    return min(received.output.time_ns, received.received_ns)


class BoundedQueue:
    """A bounded queue between two threads that drops its oldest message when full, and counts."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._waiting: deque[Received] = deque()
        self._capacity = capacity
        self._lock = threading.Lock()
        self._arrivals_ns: deque[int] = deque(maxlen=RATE_SPAN)
        self.messages = 0
        self.dropped = 0
        self.latest: Received | None = None
        """The freshest measurement, which need not be the one that came last."""

    def put(self, received: Sequence[Received]) -> None:
        """Append messages."""
        with self._lock:
            self._waiting.extend(received)
            while len(self._waiting) > self._capacity:
                self._waiting.popleft()
                self.dropped += 1
            for one in received:
                if not isinstance(one.output, Diagnostic):
                    self.messages += 1
                    self.latest = one if self.latest is None or true_ns(one) >= true_ns(self.latest) else self.latest
                    self._arrivals_ns.append(one.received_ns)

    def take(self) -> list[Received]:
        """All waiting messages, oldest first, which are removed."""
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
        return taken

    def rate_hz(self) -> float | None:
        """Messages a second over the last few; None while there are fewer than two."""
        with self._lock:
            times = list(self._arrivals_ns)
        span_ns = times[-1] - times[0] if times else 0
        return (len(times) - 1) / seconds(span_ns) if span_ns > 0 else None


class Supervisor:
    """Runs drivers until it is closed; a context manager. `take` is for one reader, the rest for any thread."""

    def __init__(self, lifecycles: Sequence[DriverLifecycle], clock: Clock, *, capacity: int = CAPACITY) -> None:
        self._lifecycles = {lifecycle.name: lifecycle for lifecycle in lifecycles}
        self._queues = {lifecycle.name: BoundedQueue(capacity) for lifecycle in lifecycles}
        self._clock = clock
        self._stopping = threading.Event()
        self._news = threading.Event()
        self._taken_ns = 0
        self._threads = [
            threading.Thread(target=self._serve, args=(one,), name=one.name, daemon=True) for one in lifecycles
        ]

    def __enter__(self) -> Supervisor:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close all devices; what they emitted before can still be taken."""
        self._stopping.set()
        for thread in self._threads:
            thread.join(timeout=10.0 * POLL_S)  # one that its device holds up is left behind: it is a daemon

    def _serve(self, lifecycle: DriverLifecycle) -> None:
        queue = self._queues[lifecycle.name]
        while not self._stopping.is_set():
            before = lifecycle.state
            received = lifecycle.step(POLL_S)
            queue.put(received)
            if received or lifecycle.state is not before:
                self._news.set()
        lifecycle.close()

    def take(self, timeout_s: float) -> list[Received]:
        """Outputs of all sensors since the last call, by time of arrival; waits at most ``timeout_s`` for the first.

        What was held up on its way into the queue counts as received with the last that was handed out before it:
        arrivals never run backwards, for a log is read in their order.
        """
        self._news.wait(timeout_s)
        self._news.clear()
        came = sorted((one for queue in self._queues.values() for one in queue.take()), key=lambda one: one.received_ns)
        taken = [one._replace(received_ns=max(one.received_ns, self._taken_ns)) for one in came]
        self._taken_ns = taken[-1].received_ns if taken else self._taken_ns
        return taken

    def latest(self, name: str, max_age_s: float) -> DriverOutput:
        """The freshest measurement of sensor ``name``; raises `DeviceLostError` where that is older."""
        if name not in self._queues:
            raise NotFoundError(f"there is no sensor {name!r}", did_you_mean(name, self._queues))
        last = self._queues[name].latest
        age_ns = None if last is None else self._clock.now_ns() - true_ns(last)
        if last is None or age_ns is None or age_ns > nanoseconds(max_age_s):
            age = "nothing yet" if age_ns is None else f"its last measurement is {seconds(age_ns):.2f} s old"
            raise DeviceLostError(f"{name}: {age}, asked for at most {max_age_s:g} s", "wait, or look at its state")
        return last.output

    def statuses(self) -> list[Status]:
        """Status of every sensor, in the order they were given."""
        return [self._status(lifecycle) for lifecycle in self._lifecycles.values()]

    def _status(self, lifecycle: DriverLifecycle) -> Status:
        now_ns, queue = self._clock.now_ns(), self._queues[lifecycle.name]
        last = queue.latest
        hung = lifecycle.state is not State.CLOSED and now_ns - lifecycle.stepped_ns > nanoseconds(HUNG_S)
        return Status(
            lifecycle.name,
            State.STALLED if hung else lifecycle.state,
            queue.rate_hz() if lifecycle.state is State.RUNNING else None,
            None if last is None else seconds(now_ns - true_ns(last)),
            queue.messages,
            queue.dropped,
            lifecycle.losses,
            "its device holds the driver up" if hung else str(lifecycle.error or ""),
        )
