"""Base of the two Wi-Fi drivers: opening all or nothing, polling their loop, distinguishing loss from silence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, Generic

from fusion.driver import Clock, DeviceInfo, Diagnostic, DriverOutput, Level
from fusion.errors import DeviceLostError, DriverError
from sensors.wifi.errors import lost, refused, require_pyroute2
from sensors.wifi.interface import Interface, look_up, require_there
from sensors.wifi.loop import Loop, Result, Trouble
from sensors.wifi.nl80211 import KernelTransport, Nl80211, Transport


class WifiDriver(ABC, Generic[Result]):
    """A driver of one interface; a subclass adds the loop and the outputs of its results."""

    groups: ClassVar[tuple[str, ...]] = ()
    """Groups of events to join."""

    def __init__(self, name: str, clock: Clock, interface: str, device: Transport | None) -> None:
        self._name, self._clock = name, clock
        self._interface_name = interface
        self._nl80211 = Nl80211(KernelTransport() if device is None else device)
        self._interface: Interface | None = None
        self._loop: Loop[Result] | None = None

    def open(self) -> DeviceInfo:
        """Join the events, look the interface up, ask for the first result: what is refused shows here."""
        require_pyroute2()
        self.close()
        try:
            self._nl80211.open(*self.groups)
            interface = look_up(self._nl80211, self._interface_name)
            loop = self._made(self._nl80211, interface)
            loop.start()
            settings = self._settings_of(self._nl80211, interface)
        except Exception as error:
            self._nl80211.close()
            if isinstance(error, OSError):
                raise refused(error, self._interface_name, "to be opened") from error
            raise
        self._interface, self._loop = interface, loop
        model = f"{interface.driver or 'Wi-Fi radio'} on phy{interface.wiphy}"
        return DeviceInfo(model, serial=interface.mac, settings=MappingProxyType(dict(settings)))

    def poll(self, timeout_s: float) -> Sequence[DriverOutput]:
        """Outputs of a scan or a round, or a diagnostic of its failure, or nothing yet."""
        if self._loop is None or self._interface is None:
            raise DeviceLostError(f"{self._name} is not open", "open it")
        try:
            outcome = self._loop.poll(timeout_s)
            if outcome is None:
                require_there(self._nl80211, self._interface)
        except OSError as error:
            raise lost(refused(error, self._interface.name, "to be asked")) from error
        except DriverError as error:
            raise lost(error) from error
        if outcome is None:
            return []
        if isinstance(outcome, Trouble):
            return [Diagnostic(self._clock.now_ns(), self._name, Level.WARN, outcome.text)]
        return self._outputs(outcome)

    def close(self) -> None:
        """Let go of the socket; what the radio is doing ends by itself."""
        self._nl80211.close()
        self._interface = self._loop = None

    @abstractmethod
    def _made(self, nl80211: Nl80211, interface: Interface) -> Loop[Result]:
        """The loop, not yet started; raises `DriverError` where the radio cannot do what is wanted."""

    @abstractmethod
    def _settings_of(self, nl80211: Nl80211, interface: Interface) -> Mapping[str, object]:
        """The settings in force, for the log."""

    @abstractmethod
    def _outputs(self, result: Result) -> list[DriverOutput]:
        """Measurements and diagnostics of a result."""
