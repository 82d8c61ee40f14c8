"""A serial port for drivers: typed errors, reads with a time limit, lines with the time of their first byte. The one
place that knows the serial library.
"""

from __future__ import annotations

import errno
import select
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from fusion import Clock, DeviceLostError, DriverError, Found, Needs, NotFoundError
from sensors.device_errors import device_error, missing_package

NEEDS = Needs(groups=("dialout",), modules=("serialx",))
CHUNK = 4096
LONGEST_LINE = 4096
"""Bytes after which a line without an end is given up: no module speaks so long."""


class SerialPort:
    """One port; nothing is opened before `open`."""

    def __init__(self, path: str, baudrate: int) -> None:
        self.path = path
        self.baudrate = baudrate
        self._port: Any = None

    def open(self) -> None:
        """Open it for ourselves alone; raises a `DriverError` with the remedy."""
        self.close()
        try:
            import serialx
        except ImportError as error:
            raise missing_package("serialx") from error
        try:
            port = serialx.serial_for_url(self.path, baudrate=self.baudrate, read_timeout=0, exclusive=True)
            port.open()
        except OSError as error:
            raise opening_error(self.path, error) from error
        except ValueError as error:
            raise NotFoundError(
                f"{self.path}: {error}", "give the path of a port: `fusion sensors` lists them"
            ) from error
        self._port = port

    def read(self, timeout_s: float) -> bytes:
        """Bytes that arrived, after a wait of at most so long for the first; empty when none did."""
        port = self._require()
        try:
            if not select.select([port.fileno()], [], [], max(timeout_s, 0.0))[0]:
                return b""
            return bytes(port.read(CHUNK))
        except (OSError, ValueError) as error:
            raise self._lost(error) from error

    def write(self, data: bytes) -> None:
        """Send bytes."""
        port = self._require()
        try:
            port.write(data)
        except OSError as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Let go of it; never raises."""
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError:
                return  # the device went away: there is nothing left to let go of

    def _require(self) -> Any:  # noqa: ANN401 - the library's port
        if self._port is None:
            raise DeviceLostError(f"{self.path} is not open", "open the driver first")
        return self._port

    def _lost(self, error: Exception) -> DeviceLostError:
        return DeviceLostError(f"{self.path} went away ({error})", "plug it in again, and look at its cable")


def opening_error(path: str, error: OSError) -> DriverError:
    """Error for a refusal to open a port (open(2), flock(2))."""
    if error.errno == errno.ENOTTY:
        return NotFoundError(f"{path} is no serial port", "give the path of a port: `fusion sensors` lists them")
    absent = "plug it in; `fusion sensors` lists the ports that are there"
    busy = f"stop the other program: fuser -v {path} names it"
    return device_error(path, error, group="dialout", absent=absent, busy=busy)


def find_ports() -> list[Found]:
    """The serial ports of USB devices, by names that stay the same over reboots."""
    try:
        import serialx

        ports = serialx.list_serial_ports()
    except (ImportError, OSError):
        return []
    return [
        Found(str(port.device), " ".join(filter(None, (port.manufacturer, port.product))), _settings(str(port.device)))
        for port in ports
        if port.vid is not None
    ]


def _settings(path: str) -> Mapping[str, object]:
    return MappingProxyType({"port": path})


class Line(NamedTuple):
    """One line without its end, and when its first byte came."""

    time_ns: int
    text: str


class LineReader:
    """Cuts a stream of bytes into lines; what is no text is replaced, what never ends is dropped and counted."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._rest = b""
        self._began_ns = 0
        self.overlong = 0
        """Lines given up because they did not end."""

    def feed(self, data: bytes) -> Iterator[Line]:
        """The lines that ``data`` completes."""
        now_ns = self._clock.now_ns()
        for piece in data.replace(b"\r", b"\n").splitlines(keepends=True):
            if not self._rest:
                self._began_ns = now_ns
            self._rest += piece
            if self._rest.endswith(b"\n"):
                text = self._rest.decode("ascii", "replace").strip()
                self._rest = b""
                if text:
                    yield Line(self._began_ns, text)
            elif len(self._rest) > LONGEST_LINE:
                self._rest = b""
                self.overlong += 1

    @property
    def unfinished(self) -> str:
        """Text after the last end of a line: a prompt, perhaps."""
        return self._rest.decode("ascii", "replace")
