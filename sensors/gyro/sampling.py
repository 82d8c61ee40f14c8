"""Base of the drivers for gyros that are polled: a pace, an axis, a stamp in the middle of the reading.

Samples are due at whole periods from the opening on. A program that is held up skips and counts what it missed,
instead of reading the past in a hurry. The bias is never taken off: `sensors.onboard.gyro_bias` measures it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple

from fusion import Clock, DeviceInfo, DeviceLostError, Diagnostic, DriverOutput, DriverSpec, Level, Needs, SettingError
from fusion.values import Gyro, nanoseconds, seconds

AXES = {"x": 0, "y": 1, "z": 2}
TEMPERATURE_S = 10.0
"""Period of the temperature reports: it changes slowly, and the bias with it."""
Vector = tuple[float, float, float]


class Sample(NamedTuple):
    """One reading in the chip's own axes: turn rates [rad/s], accelerations [m/s²], temperature [°C], where it has
    them.
    """

    rate_rad_s: Vector
    acceleration_m_s2: Vector | None = None
    temperature_c: float | None = None


class UnreadableError(Exception):
    """A reading that no sensor gives: a bus that dropped out for a moment. It costs that reading."""


class SampledGyro:
    """A gyro that is asked for its samples; base of a driver for each chip.

    ``axis`` is the chip's axis that points up, as ``+z`` or ``-x``: a left turn comes out positive.
    """

    needs: ClassVar[Needs]

    def __init__(self, name: str, clock: Clock, *, axis: str = "+z", hz: float = 100.0) -> None:
        sign, letter = axis[:1], axis[1:]
        if sign not in ("+", "-") or letter not in AXES:
            raise SettingError(f"{name}: axis = {axis!r}", "give the chip's axis that points up: +z, -z, +x, ...")
        if not 0.0 < hz <= 1000.0:
            raise SettingError(f"{name}: hz = {hz}", "give a rate up to 1000 Hz")
        self._name, self._clock = name, clock
        self._axis, self._sign, self._period_ns = AXES[letter], 1.0 if sign == "+" else -1.0, nanoseconds(1.0 / hz)
        self._settings: dict[str, object] = {"axis": axis, "hz": hz}
        self._due_ns = self._warm_ns = 0
        self._missed = 0
        self._seq = 0
        self._is_open = False
        self.spec = DriverSpec((Gyro,), hz, 0.5 * hz, self.needs)

    def open(self) -> DeviceInfo:
        """Start the chip, with its settings read back."""
        self.close()
        try:
            model, settings = self._start()
        except BaseException:
            self._stop()
            raise
        self._is_open = True
        self._due_ns = self._warm_ns = self._clock.now_ns()
        return DeviceInfo(model, settings={**self._settings, **settings})

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """The next sample, if it falls due in time."""
        if not self._is_open:
            raise DeviceLostError(f"{self._name} is not open", "open the driver first")
        left_s = seconds(self._due_ns - self._clock.now_ns())
        self._clock.sleep(min(left_s, timeout_s))
        began_ns = self._clock.now_ns()
        if began_ns < self._due_ns:
            return []
        late = (began_ns - self._due_ns) // self._period_ns
        self._missed += late
        self._due_ns += (late + 1) * self._period_ns
        try:
            sample = self._read()
        except UnreadableError as error:
            return [self._diagnostic(began_ns, Level.WARN, str(error))]
        return list(self._outputs(sample, (began_ns + self._clock.now_ns()) // 2))

    def close(self) -> None:
        """Let go of the chip."""
        self._is_open = False
        self._stop()

    def _start(self) -> tuple[str, dict[str, object]]:
        """Model and settings of the chip, which samples from now on."""
        raise NotImplementedError

    def _stop(self) -> None:
        """Let go of it, in any state."""
        raise NotImplementedError

    def _read(self) -> Sample:
        """One sample; raises `UnreadableError` or a `DriverError`."""
        raise NotImplementedError

    def _outputs(self, sample: Sample, time_ns: int) -> Iterator[DriverOutput]:
        self._seq += 1
        rate = self._sign * sample.rate_rad_s[self._axis]
        yield Gyro(time_ns, self._name, self._seq, rate, sample.acceleration_m_s2)
        if time_ns >= self._warm_ns:
            self._warm_ns = time_ns + nanoseconds(TEMPERATURE_S)
            missed, self._missed = self._missed, 0
            values = [] if sample.temperature_c is None else [("temperature_c", f"{sample.temperature_c:.2f}")]
            values += [("samples missed", str(missed))] if missed else []
            if values:
                yield self._diagnostic(time_ns, Level.OK, "state of the chip", *values)

    def _diagnostic(self, time_ns: int, level: Level, text: str, *values: tuple[str, str]) -> Diagnostic:
        return Diagnostic(time_ns, self._name, level, text, values)
