"""Everything this project raises on purpose, one leaf per remedy.

    FusionError
    ├── PluginError       an estimator or driver could not be brought in   → install, rename, uninstall one
    ├── ParameterError    an option has no such name or value              → correct the option
    ├── WorldError        a world description contradicts itself           → edit the world file
    ├── MeasurementError  a measurement breaks the contract                → fix the driver or the log
    ├── LogError          a file cannot be read as a run                   → repair it, or give another file
    ├── RecordingError    a foreign recording cannot be imported           → compare the folder with the docs
    ├── SuiteError        a suite of benchmarks contradicts itself         → edit the suite file
    ├── ConformanceError  an estimator breaks a promise of the contract    → fix the estimator
    └── ViewerError       the Rerun viewer cannot be used here             → install what the message names

``except FusionError`` catches them all. A message says what, which value, where, and what to do next.
"""

from __future__ import annotations

from collections.abc import Iterable


class FusionError(Exception):
    """Anything this project raises on purpose."""


class PluginError(FusionError):
    """An estimator or driver could not be found or brought in."""


class ParameterError(FusionError):
    """An option has no such name, or its value is refused."""


class WorldError(FusionError):
    """A world description is incomplete or contradicts itself."""


class MeasurementError(FusionError):
    """A measurement breaks the contract: its shape, its unit or its time."""


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


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown ``name``: its nearest match, or the list of what is known.

    >>> did_you_mean("efk", ["ekf", "particle"])
    "did you mean 'ekf'?"
    >>> did_you_mean("zzz", ["ekf", "particle"])
    'known: ekf, particle'
    """
    import difflib

    candidates = sorted(known)
    near = difflib.get_close_matches(name, candidates, n=1, cutoff=0.6)
    if near:
        return f"did you mean {near[0]!r}?"
    return f"known: {', '.join(candidates) or 'none'}"
