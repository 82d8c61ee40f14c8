"""Commands to the motors, which the robot's motor controller sends to a socket, one datagram each.

    import json, socket
    socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM).sendto(json.dumps([0.3, 0.3]).encode(), "/run/fusion/motors")

The numbers are the signed speeds of the wheels [m/s], in the order of the world's robot. A single-channel encoder
cannot see its direction, and takes it from here; a command stands until the next. The controller repeats it now and
then, for a recorder that begins later.
"""

from __future__ import annotations

import json
import math
import os
import select
import socket
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from fusion import (
    BootClock,
    Clock,
    DeviceInfo,
    DeviceLostError,
    Diagnostic,
    DriverError,
    DriverOutput,
    DriverSpec,
    Found,
    Level,
)
from fusion.values import MotorCommand
from sensors.device_errors import device_error

SOCKET = "/run/fusion/motors"
LONGEST = 1024
WHEELS = (2, 4)


def parse(datagram: bytes) -> tuple[float, ...] | None:
    """Wheel speeds [m/s] from a datagram, None for what is none.

    >>> parse(b"[0.3, -0.3]"), parse(b"[1]"), parse(b"stop")
    ((0.3, -0.3), None, None)
    """
    try:
        found = json.loads(datagram)
    except ValueError:
        return None
    if not isinstance(found, list) or len(found) not in WHEELS:
        return None
    if not all(isinstance(speed, int | float) and math.isfinite(speed) for speed in found):
        return None
    return tuple(map(float, found))


class Motors:
    """Listens on a Unix socket at ``path``, which it makes and removes."""

    summary: ClassVar[str] = "motor commands, sent to a socket by the robot's motor controller"

    def __init__(self, name: str, clock: Clock, *, path: str = SOCKET, hz: float = 1.0) -> None:
        """``hz``: how often the controller speaks, for lists; however long it is silent, it does not count as lost."""
        self._name, self._clock, self._path = name, clock, Path(path)
        self._socket: socket.socket | None = None
        self._seq = 0
        self.spec = DriverSpec((MotorCommand,), hz, 0.0)

    @classmethod
    def discover(cls) -> list[Found]:
        """A socket can be made anywhere."""
        return [Found(SOCKET, "socket for the motor controller", MappingProxyType({}))]

    @classmethod
    @contextmanager
    def fake(cls) -> Iterator[FakeController]:
        """A controller that sends when it is asked to."""
        with tempfile.TemporaryDirectory() as folder:
            yield FakeController(Path(folder) / "run")

    def open(self) -> DeviceInfo:
        """Make the socket; one that an earlier recorder left behind is replaced."""
        self.close()
        made = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            self._path.unlink(missing_ok=True)
            made.bind(str(self._path))
        except OSError as error:
            made.close()
            raise self._refused(error) from error
        self._socket = made
        return DeviceInfo("motor commands", settings={"path": str(self._path)})

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """The next command."""
        if self._socket is None or not self._path.exists():
            raise DeviceLostError(f"{self._name}: the socket {self._path} is gone", "it is made again by itself")
        if not select.select([self._socket], [], [], max(timeout_s, 0.0))[0]:
            return []
        datagram, now_ns = self._socket.recv(LONGEST), self._clock.now_ns()
        speeds = parse(datagram)
        if speeds is None:
            text = "a command that cannot be understood"
            return [Diagnostic(now_ns, self._name, Level.WARN, text, (("datagram", repr(datagram[:100])),))]
        self._seq += 1
        return [MotorCommand(now_ns, self._name, self._seq, speeds)]

    def close(self) -> None:
        """Let go of the socket, and remove it."""
        held, self._socket = self._socket, None
        if held is not None:
            held.close()
            with suppress(OSError):
                self._path.unlink(missing_ok=True)

    def _refused(self, error: OSError) -> DriverError:
        absent = f"sudo install -d -o $USER {self._path.parent}, or name another path"
        return device_error(f"{self._name}: {self._path}", error, group="robot", absent=absent, busy=absent)


class FakeController:
    """The motor controller on the other side; unplugging takes the folder of the socket away."""

    def __init__(self, folder: Path) -> None:
        self.clock = BootClock()
        self._folder, self._path = folder, folder / "motors"
        self.settings = {"path": str(self._path)}
        self.plug()

    def speak(self) -> None:
        """Send a command."""
        self._send(b"[0.3, 0.3]")

    def garble(self) -> None:
        """Send nonsense."""
        self._send(b"full speed")

    def plug(self) -> None:
        """Give the folder back."""
        self._folder.mkdir()

    def unplug(self) -> None:
        """Take it away."""
        self._path.unlink(missing_ok=True)
        self._folder.rmdir()

    def _send(self, datagram: bytes) -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
            link.sendto(datagram, os.fspath(self._path))
