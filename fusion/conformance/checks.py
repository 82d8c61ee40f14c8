"""The conformance kit: an estimator class held against every promise of the contract.

`checks` yields those that apply to a class, for pytest; `run_checks` runs them by name and answers with verdicts. The
promises stand in modules of their own, by what they are about. Both treat ours and strangers' estimators alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum, unique
from typing import Any, NamedTuple

from fusion.conformance import answer_promises, motion_promises, purity_promises, robustness_promises, time_promises
from fusion.conformance.promise import Promise
from fusion.errors import ConformanceError, DependencyError, ParameterError, did_you_mean
from fusion.plugins import load

PROMISES: list[Promise] = [
    *purity_promises.PROMISES,
    *answer_promises.PROMISES,
    *time_promises.PROMISES,
    *motion_promises.PROMISES,
    *robustness_promises.PROMISES,
]
"""Every promise of an estimator, in the order in which verdicts are listed."""


class Check(NamedTuple):
    """One promise put to one class, of an estimator or a driver."""

    promise: Promise
    made: type[Any]

    @property
    def id(self) -> str:
        """The promise's id."""
        return self.promise.id

    def run(self) -> None:
        """Raises `ConformanceError` when the promise is broken; whatever the class raises passes through."""
        self.promise.test(self.made)


@unique
class Outcome(Enum):
    """Outcome of a check."""

    KEPT = "kept"
    BROKEN = "broken"
    EXCUSED = "excused"
    SKIPPED = "skipped"


class Verdict(NamedTuple):
    """Outcome of a check, and its counter-example or excuse."""

    id: str
    reason: str
    outcome: Outcome
    detail: str = ""


def checks(estimator: type[Any]) -> Iterator[Check]:
    """The checks that apply to ``estimator`` by its tags, in a fixed order."""
    return (Check(promise, estimator) for promise in PROMISES if not promise.excuse(estimator))


def run_checks(name: str, expected_failures: Mapping[str, str] | None = None) -> list[Verdict]:
    """A verdict on every promise for the installed estimator ``name``.

    ``expected_failures`` excuses promises by id, with the reason; one that is kept after all counts as broken. Raises
    `PluginError` for an unknown estimator, `ParameterError` for an unknown id, `DependencyError` for a missing package.
    """
    excuses = expected_failures or {}
    known = [promise.id for promise in PROMISES]
    for promise_id in excuses:
        if promise_id not in known:
            raise ParameterError(f"there is no promise {promise_id!r}; {did_you_mean(promise_id, known)}")
    made = load(name)
    return [verdict(Check(promise, made), excuses.get(promise.id)) for promise in PROMISES]


def verdict(check: Check, excuse: str | None = None) -> Verdict:
    """The verdict of one check; raises `DependencyError` where a package is missing, which breaks no promise."""
    promise = check.promise
    if skip := promise.excuse(check.made):
        return Verdict(promise.id, promise.reason, Outcome.SKIPPED, skip)
    try:
        check.run()
    except ConformanceError as broken:
        detail = str(broken)
    except DependencyError:
        raise
    except Exception as error:  # noqa: BLE001 - a stranger's code may fail in any way; here that is an answer
        detail = f"it failed: {error!r}"
    else:
        detail = "" if excuse is None else f"kept after all: take away the excuse {excuse!r}"
        outcome = Outcome.KEPT if excuse is None else Outcome.BROKEN
        return Verdict(promise.id, promise.reason, outcome, detail)
    if excuse is not None:
        return Verdict(promise.id, promise.reason, Outcome.EXCUSED, f"{excuse} ({detail})")
    return Verdict(promise.id, promise.reason, Outcome.BROKEN, detail)
