"""Everything this project raises on purpose, one leaf per remedy.

    FusionError
    ├── PluginError       an estimator or driver could not be brought in   → install, rename, uninstall one
    │   └── NotInstalledError  a package that it needs is missing          → the ``pip install`` that it names
    ├── ParameterError    an option has no such name or value              → correct the option
    ├── WorldError        a world description contradicts itself           → edit the world file
    ├── MeasurementError  a measurement breaks the contract                → fix the driver or the log
    ├── BeliefError       a pose with its covariance cannot be believed    → correct the number it names
    ├── LogError          a file cannot be read as a run                   → repair it, or give another file
    ├── RecordingError    a foreign recording cannot be imported           → compare the folder with the docs
    ├── SuiteError        a suite of benchmarks contradicts itself         → edit the suite file
    ├── ConformanceError  an estimator breaks a promise of the contract    → fix the estimator
    ├── ViewerError       the Rerun viewer cannot be used here             → install what the message names
    └── DriverError       a sensor cannot be used now                      → follow its ``hint``
        ├── SettingError           a setting is refused, by us or by the device  → correct the robot file
        ├── DependencyError        a package or tool is missing                  → install it
        ├── UnsupportedError       the device or kernel cannot do this           → another device or backend
        ├── NotPermittedError      this user may not                             → the capability or group it names
        ├── NotFoundError          the device is not there                       → plug it in; we go on looking
        ├── BusyError              somebody else has it                          → stop that one; we go on trying
        ├── DeviceLostError        it was there and went away                    → nothing; we go on trying
        └── ProtocolError          its bytes cannot be understood                → check firmware and wiring

``except FusionError`` catches them all. A message states what, which value, where, and what to do next.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar


class FusionError(Exception):
    """Anything this project raises on purpose."""


class PluginError(FusionError):
    """An estimator or driver could not be found or brought in."""


class NotInstalledError(PluginError):
    """The plug-in ``name`` needs a package that is missing; ``cause`` names that and the remedy, but no plug-in."""

    def __init__(self, name: str, cause: str) -> None:
        super().__init__(name, cause)
        self.name = name
        self.cause = cause

    def __str__(self) -> str:
        """Name and cause in one sentence."""
        return f"{self.name}: {self.cause}"


class ParameterError(FusionError):
    """An option has no such name, or its value is refused."""


class WorldError(FusionError):
    """A world description is incomplete or contradicts itself."""


class MeasurementError(FusionError):
    """A measurement breaks the contract: its shape, its unit or its time."""


class BeliefError(FusionError):
    """A pose is not finite, or its covariance is none: not finite, not symmetric or not positive semi-definite."""


class LogError(FusionError):
    """A file cannot be read, or written, as a run."""


class RecordingError(FusionError):
    """A foreign recording cannot be imported."""


class SuiteError(FusionError):
    """A suite of benchmarks is incomplete or contradicts itself."""


class ConformanceError(FusionError):
    """An estimator breaks a promise of the contract; the message is the counter-example."""


class ViewerError(FusionError):
    """The Rerun viewer cannot be used on this machine."""


class DriverError(FusionError):
    """A sensor cannot be used now. ``hint`` is what cures it, a command where one does."""

    passes: ClassVar[bool] = False
    """Whether it may pass by itself, so that trying again makes sense; if not, a person is needed."""

    def __init__(self, what: str, hint: str) -> None:
        super().__init__(f"{what}; {hint}")
        self.what = what
        self.hint = hint


class SettingError(DriverError):
    """A setting of a driver is refused, by us or by the device."""


class DependencyError(DriverError):
    """A Python package or a program that the driver needs is not installed."""


class UnsupportedError(DriverError):
    """The device, its firmware or this kernel cannot do what is asked."""


class NotPermittedError(DriverError):
    """The user who runs this may not use the device."""


class NotFoundError(DriverError):
    """The device is not there."""

    passes = True


class BusyError(DriverError):
    """Somebody else has the device."""

    passes = True


class DeviceLostError(DriverError):
    """The device was there and went away, or fell silent."""

    passes = True


class ProtocolError(DriverError):
    """The device sends what cannot be understood."""

    passes = True


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown ``name``: its nearest match, or the list of what is known.

    >>> did_you_mean("efk", ["ekf", "particle"])
    "did you mean 'ekf'?"
    >>> did_you_mean("zzz", ["ekf", "particle"])
    'known: ekf, particle'
    """
    candidates = sorted(known)
    near = nearest(name, candidates)
    return f"known: {', '.join(candidates) or 'none'}" if near is None else f"did you mean {near!r}?"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The one of ``known`` that ``name`` was probably meant to be."""
    import difflib

    return next(iter(difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.6)), None)
