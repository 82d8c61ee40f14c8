"""Lifecycle of one driver: open it, poll it, close it when it falls silent or is lost, and try again.

    CLOSED → OPENING → RUNNING → STALLED → BACKOFF → OPENING …        FAILED: a person is needed

A device that is not there at the start takes the same path as one that is lost on the way. There is one diagnostic for
the loss of a sensor and one for its return, however many tries lie between. There is no thread here: `step` does one
step, so that a virtual clock can drive it through hours of trouble.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from enum import Enum, unique
from typing import NamedTuple

from fusion.driver import Clock, DeviceInfo, Diagnostic, Driver, DriverOutput, Level
from fusion.errors import DeviceLostError, DriverError
from fusion.values import nanoseconds, seconds

FIRST_WAIT_S, LONGEST_WAIT_S = 0.2, 30.0
HEALTHY_NS = nanoseconds(60.0)
"""A device that ran this long begins anew with the shortest wait when it is lost."""
LEAST_SILENCE_S = 1.0
PERIODS_OF_SILENCE = 3.0


@unique
class State(Enum):
    """State of a driver."""

    CLOSED = "closed"
    OPENING = "opening"
    RUNNING = "running"
    STALLED = "stalled"
    BACKOFF = "backoff"
    FAILED = "failed"


class Received(NamedTuple):
    """An output of a driver, and the time at which it arrived [ns]."""

    received_ns: int
    output: DriverOutput


class DriverLifecycle:
    """One driver and its state. ``state``, ``error`` and ``info`` may be read from any thread."""

    def __init__(self, name: str, driver: Driver, clock: Clock, *, fail_fast: bool = False, seed: int = 0) -> None:
        self.name = name
        self.driver = driver
        self.state = State.CLOSED
        self.error: DriverError | None = None
        self.info: DeviceInfo | None = None
        self.last_ns: int | None = None
        """Arrival of its last message; None before the first."""
        self.stepped_ns = clock.now_ns()
        """Beginning of its last step: long ago, if the device holds its driver up."""
        self.losses = 0
        self._clock = clock
        self._fail_fast = fail_fast
        self._random = random.Random(seed)  # spreads the tries of several robots; it decides nothing else
        self._wait_s = FIRST_WAIT_S
        self._until_ns = 0
        self._opened_ns = 0
        self._is_missed = False

    @property
    def silence_s(self) -> float:
        """Longest silence of a healthy driver [s]; infinite for one that emits only when something happens."""
        least_hz = self.driver.spec.least_hz
        return max(PERIODS_OF_SILENCE / least_hz, LEAST_SILENCE_S) if least_hz > 0.0 else float("inf")

    def step(self, timeout_s: float) -> list[Received]:
        """One step of at most about ``timeout_s``; what arrived, diagnostics on the driver itself among it."""
        self.stepped_ns = self._clock.now_ns()
        if self.state is State.FAILED:
            self._clock.sleep(timeout_s)
            return []
        if self.state is State.RUNNING:
            return self._poll(timeout_s)
        left_s = seconds(self._until_ns - self._clock.now_ns())
        if self.state is State.BACKOFF and left_s > 0.0:
            self._clock.sleep(min(left_s, timeout_s))
            return []
        return self._open()

    def close(self) -> None:
        """Close the device for good."""
        self.driver.close()
        if self.state is not State.FAILED:
            self.state = State.CLOSED

    def _open(self) -> list[Received]:
        self.state = State.OPENING
        try:
            self.info = self.driver.open()
        except DriverError as error:
            return self._lost(error)
        except Exception as error:  # noqa: BLE001 - a stranger's driver may fail in any way; the others go on
            return self._lost(_unexpected(self.name, error))
        self.state, self.error = State.RUNNING, None
        self._opened_ns = self._clock.now_ns()
        return []

    def _poll(self, timeout_s: float) -> list[Received]:
        try:
            outputs = self.driver.poll(timeout_s)
        except DriverError as error:
            return self._lost(error)
        except Exception as error:  # noqa: BLE001 - as above
            return self._lost(_unexpected(self.name, error))
        now_ns = self._clock.now_ns()
        if outputs:
            return self._received(outputs, now_ns)
        silent_s = seconds(now_ns - max(self._opened_ns, self.last_ns or 0))
        if silent_s <= self.silence_s:
            return []
        self.state = State.STALLED
        return self._lost(DeviceLostError(f"{self.name} has been silent for {silent_s:.1f} s", "check its cable"))

    def _received(self, outputs: Sequence[DriverOutput], now_ns: int) -> list[Received]:
        back = self._is_missed
        self._is_missed = False
        self.last_ns = now_ns
        if now_ns - self._opened_ns >= HEALTHY_NS:
            self._wait_s = FIRST_WAIT_S
        news = [self._diagnostic(Level.OK, f"{self.name} is back")] if back else []
        return [*news, *(Received(now_ns, output) for output in outputs)]

    def _lost(self, error: DriverError) -> list[Received]:
        """Close, report it once, and wait: a little longer each time, and never quite as long as another robot."""
        self.driver.close()
        self.error = error
        if self._fail_fast or not error.passes:
            self.state = State.FAILED
            return [self._diagnostic(Level.ERROR, str(error))]
        self.state = State.BACKOFF
        self._until_ns = self._clock.now_ns() + nanoseconds(self._wait_s * self._random.uniform(0.5, 1.0))
        self._wait_s = min(2.0 * self._wait_s, LONGEST_WAIT_S)
        if self._is_missed:
            return []
        self._is_missed = True
        self.losses += 1
        return [self._diagnostic(Level.WARN, str(error))]

    def _diagnostic(self, level: Level, text: str) -> Received:
        now_ns = self._clock.now_ns()
        return Received(now_ns, Diagnostic(now_ns, self.name, level, text, (("state", self.state.value),)))


def _unexpected(name: str, error: Exception) -> DriverError:
    return DeviceLostError(f"{name} failed: {error!r}", "its driver is at fault; report it to the driver's author")
