"""States of an estimator over time, and its events in words.

States follow from the fates of radio readings and from the estimates' own flags, so they mean the same for every
method.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, unique
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.fates import DECISIONS, REASONS, FateColumns
from benchmarks.review.columns import EstimateColumns
from fusion import Decision, Reason, Update
from fusion.arrays import Stamps, Whole

LOST_PROBABILITY = 0.5
"""An estimator that is more likely lost than not, is."""
OWN_REFUSALS = (Reason.TOO_FEW_ANCHORS, Reason.COLLINEAR_ANCHORS)
"""Unusable by the estimator's own judgement; the host's refusals do not depend on the estimator."""


@unique
class State(Enum):
    """INIT: no position yet, or no reading judged yet. ACCEPT, REJECT: something, or nothing, of the last scan was
    taken. LOST: no valid position, or the estimator itself reports it.
    """

    INIT = 0
    ACCEPT = 1
    REJECT = 2
    LOST = 3


class States(NamedTuple):
    """Changes of state: time [ns], and the state from then on."""

    time_ns: Stamps
    state: list[State]


class Events(NamedTuple):
    """Lines of a log, all (n,), in time order."""

    time_ns: Stamps
    level: list[str]
    text: list[str]


def states(estimates: EstimateColumns, fates: FateColumns, fate_update: Whole) -> States:
    """The states of an estimator; none for a method that never judged a reading and was never lost. ``fate_update``
    (m,): the index of the estimate that each of ``fates`` led to.
    """
    judged = _judged(fates, fate_update, len(estimates.valid))
    last = np.maximum.accumulate(np.where(judged >= 0, np.arange(len(judged)), 0))
    located = np.logical_or.accumulate(estimates.valid)
    begun = np.logical_or.accumulate(judged >= 0) & located
    state = np.where(begun, judged[last], State.INIT.value)
    state[(located & ~estimates.valid) | (estimates.p_lost > LOST_PROBABILITY)] = State.LOST.value
    if not (state > State.INIT.value).any():
        return States(np.array([], dtype=np.int64), [])
    changes = np.flatnonzero(np.diff(state, prepend=-1))
    return States(estimates.time_ns[changes], [State(code) for code in state[changes].tolist()])


def _judged(fates: FateColumns, fate_update: Whole, count: int) -> Whole:
    """For each update whether its readings were taken (ACCEPT), all refused (REJECT), or not judged (-1)."""
    taken = fates.met(Decision.USED, Decision.DOWNWEIGHTED)
    refused = fates.met(Decision.REJECTED) | fates.met(*OWN_REFUSALS)
    judged = np.full(count, -1, dtype=np.int64)
    judged[fate_update[refused]] = State.REJECT.value
    judged[fate_update[taken]] = State.ACCEPT.value
    return judged


def events(updates: Sequence[Update], estimates: EstimateColumns, fates: FateColumns) -> Events:
    """Rejected, late and unusable readings, resets, and the position's loss and return."""
    rows = [*_readings(fates), *_resets(updates, estimates.reset_count), *_losses(estimates)]
    rows.sort()
    return Events(np.array([row[0] for row in rows], dtype=np.int64), [r[1] for r in rows], [r[2] for r in rows])


Row = tuple[int, str, str]


def _readings(fates: FateColumns) -> list[Row]:
    """One line per reading that was not taken; a reading of a kind that a method does not use is no event."""
    chosen = fates.met(Decision.REJECTED, Decision.LATE, Decision.UNUSABLE) & ~fates.met(Reason.KIND_NOT_CONSUMED)
    columns = (fates.time_ns, fates.names[fates.source], fates.decision, fates.reason, fates.nis)
    rows = zip(*(column[chosen].tolist() for column in columns), strict=True)
    return [(t, *_line(name, DECISIONS[decision], REASONS[reason], nis)) for t, name, decision, reason, nis in rows]


def _line(name: str, decision: Decision, reason: Reason, nis: float) -> tuple[str, str]:
    why = reason.value.replace("_", " ")
    surprise = f", NIS {nis:.1f}" if np.isfinite(nis) else ""
    level = "WARN" if decision is Decision.REJECTED else "INFO"
    return level, f"{name} {decision.value}: {why}{surprise}"


def _resets(updates: Sequence[Update], reset_count: Whole) -> list[Row]:
    rows = []
    for place in np.flatnonzero(np.diff(reset_count, prepend=reset_count[:1]) > 0).tolist():
        estimate = updates[place].estimate
        jump = "" if estimate.reset_delta is None else f", moved by {np.hypot(*estimate.reset_delta[:2]):.2f} m"
        rows.append((estimate.time_ns, "WARN", f"belief replaced (reset {estimate.reset_count}){jump}"))
    return rows


def _losses(estimates: EstimateColumns) -> list[Row]:
    changes = np.flatnonzero(np.diff(estimates.valid, prepend=True))
    lines = {True: ("INFO", "position valid again"), False: ("ERROR", "no valid position")}
    return [(t, *lines[valid]) for t, valid in zip(*(c[changes].tolist() for c in estimates[:2]), strict=True)]
