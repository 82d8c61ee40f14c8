"""Course of the answers: convergence, failures and recovery, silence, where on the floor there were any.

A stretch of instants lasts from its first to its last one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.drift import theil_sen
from benchmarks.metrics.errors import Errors
from benchmarks.metrics.metric import Better, rows
from fusion.arrays import Flags, Whole
from fusion.quantiles import mean, quantile
from fusion.values import NANOSECONDS, nanoseconds

CONVERGED_M, CONVERGED_S = 1.0, 5.0
"""Converged: no further off than this for so long."""
FAILED_M, FAILED_S = 3.0, 2.0
"""Failed: further off than this, or without an answer, for so long."""
CELL_M = 1.0
COVERED = 0.95
"""A cell of the floor is covered when this share of its instants has a valid answer."""
FAULT = "fault with windows"
METRICS = (
    *rows("t_conv", "s", Better.LESS, "time until the error stays below 1 m for 5 s"),
    *rows("failures", "count", Better.LESS, "times that the error exceeds 3 m, or is missing, for 2 s"),
    *rows("t_recover", "s", Better.LESS, "of the worst of these, time until converged again"),
    *rows("max_in_outage", "m", Better.LESS, "of the worst of these, greatest error"),
    *rows("growth", "m/s", Better.LESS, "of the worst of these, slope of the error", signed=True),
    *rows("age_p95", "s", Better.LESS, "age of the newest estimate, 95 % quantile"),
    *rows("dropouts", "count", Better.LESS, "stretches without a valid estimate"),
    *rows("dropout_s", "s", Better.LESS, "time that all of these last"),
    *rows("coverage", "share", Better.MORE, "share of visited square metres with estimates at 95 % of the instants"),
    *rows("fault_availability", "share", Better.MORE, "share of the instants of a fault with an estimate", FAULT),
    *rows("fault_t_recover", "s", Better.LESS, "from the end of a fault until the error stays below 1 m", FAULT),
    *rows("fault_max_in_outage", "m", Better.LESS, "greatest error during a fault", FAULT),
    *rows("fault_growth", "m/s", Better.LESS, "slope of the error during a fault", FAULT, signed=True),
)
"""Of the functions below; those of faults are the worst over their windows."""


class Stretches(NamedTuple):
    """Index of the first and the last instant of each of k stretches, (k,)."""

    first: Whole
    last: Whole

    def lasting(self, time_ns: Whole, least_s: float) -> Stretches:
        """Those that last ``least_s`` or longer."""
        if len(self.first) == 0:
            return self
        long = time_ns[self.last] - time_ns[self.first] >= nanoseconds(least_s)
        return Stretches(self.first[long], self.last[long])


NONE = Stretches(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))


def stretches(mask: Flags) -> Stretches:
    """The longest stretches of instants where ``mask`` (n,) is True."""
    breaks = (mask[1:] != mask[:-1]).nonzero()[0] + 1
    if len(breaks) == 0:
        return Stretches(np.array([0]), np.array([len(mask) - 1])) if mask[:1].any() else NONE
    first = np.concatenate([[0], breaks])
    last = np.concatenate([breaks - 1, [len(mask) - 1]])
    kept = mask[first]
    return Stretches(first[kept], last[kept])


def dynamic_metrics(measured: Errors) -> dict[str, float]:
    """All of this module that needs no windows; NaN without instants."""
    return {**convergence_metrics(measured), **failure_metrics(measured), **silence_metrics(measured)}


def convergence_metrics(measured: Errors) -> dict[str, float]:
    """``t_conv`` [s] from the first instant to when it has converged; infinite if it never does, NaN of no instants."""
    time_ns = measured.time_ns
    if len(time_ns) == 0:
        return {"t_conv": math.nan}
    held = stretches(measured.position <= CONVERGED_M).lasting(time_ns, CONVERGED_S).first
    return {"t_conv": float(time_ns[held[0]] - time_ns[0]) / NANOSECONDS if len(held) else math.inf}


def failure_metrics(measured: Errors) -> dict[str, float]:
    """``failures``, and the worst of all of them: ``t_recover`` [s] from the end of one until converged again, infinite
    if never; ``max_in_outage`` [m], the greatest error of a valid answer inside it; ``growth`` [m/s], the Theil-Sen
    slope of the error inside it. NaN where there was none.
    """
    failed = stretches(measured.position > FAILED_M).lasting(measured.time_ns, FAILED_S)
    ends_ns = measured.time_ns[failed.last]
    spans = zip(failed.first.tolist(), (failed.last + 1).tolist(), ends_ns.tolist(), strict=True)
    return {"failures": float(len(failed.first)), **_worst([_outage(measured, *span) for span in spans])}


def fault_metrics(measured: Errors, start_ns: int, windows: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Effect of a fault in its ``windows`` [begin, end), seconds from ``start_ns``, of a single run.

    ``fault_availability`` is the share of the instants inside with a valid answer; NaN where instants have weights, for
    there nothing shows what was left out. ``fault_t_recover``, ``fault_max_in_outage`` and ``fault_growth`` are the
    worst over windows of what `failure_metrics` states of failures; a window that the run does not outlast has no
    recovery. All NaN without an instant inside.
    """
    elapsed_s = (measured.time_ns - start_ns) / NANOSECONDS
    outages, asked = [], [np.empty(0)]
    for begin_s, end_s in windows:
        first, beyond = np.searchsorted(elapsed_s, (begin_s, end_s)).tolist()
        if first < beyond:
            end_ns = start_ns + nanoseconds(end_s) if beyond < len(elapsed_s) else None
            outages.append(_outage(measured, first, beyond, end_ns))
            asked.append(measured.position[first:beyond])
    available = mean(np.isfinite(np.concatenate(asked))) if measured.weight is None else math.nan
    return {"fault_availability": available, **{f"fault_{name}": value for name, value in _worst(outages).items()}}


class Outage(NamedTuple):
    """Effect of one failure or fault; NaN where it cannot be stated."""

    t_recover: float
    max_in_outage: float
    growth: float


def _worst(outages: Sequence[Outage]) -> dict[str, float]:
    """The greatest of each, by name."""
    known = np.array([Outage(math.nan, math.nan, math.nan), *outages])
    return dict(zip(Outage._fields, np.fmax.reduce(known).tolist(), strict=True))


def _outage(measured: Errors, first: int, beyond: int, end_ns: int | None) -> Outage:
    """Of the instants from ``first`` up to ``beyond``; ``end_ns`` is when it ended, None if not before the run did."""
    inside = measured.position[first:beyond]
    valid = np.isfinite(inside)
    seconds = (measured.time_ns[first:beyond][valid] - measured.time_ns[first]) / NANOSECONDS
    peak = float(inside[valid].max()) if valid.any() else math.nan
    recovered = math.nan if end_ns is None else _recovery_s(measured, beyond, end_ns)
    return Outage(recovered, peak, theil_sen(seconds, inside[valid]))


def _recovery_s(measured: Errors, beyond: int, end_ns: int) -> float:
    """From ``end_ns`` until converged, sought from the instant ``beyond`` on; infinite if never."""
    rest_ns = measured.time_ns[beyond:]
    held = stretches(measured.position[beyond:] <= CONVERGED_M).lasting(rest_ns, CONVERGED_S)
    return float(rest_ns[held.first[0]] - end_ns) / NANOSECONDS if len(held.first) else math.inf


def silence_metrics(measured: Errors) -> dict[str, float]:
    """``age_p95`` [s] of the newest answer; ``dropouts``: stretches without a valid answer, and ``dropout_s``, how
    long all of them last, each up to the next answer; ``coverage``: share of the 1 m² cells of the floor the truth
    visits that are covered.
    """
    count = len(measured.position)
    if count == 0:
        return dict.fromkeys(("age_p95", "dropouts", "dropout_s", "coverage"), math.nan)
    valid = np.isfinite(measured.position)
    silent = stretches(~valid)
    return {
        "age_p95": quantile(measured.age_s, 0.95),
        "dropouts": float(len(silent.first)),
        "dropout_s": _silence_s(measured, silent) if len(silent.first) else 0.0,
        "coverage": _coverage(measured, valid),
    }


def _silence_s(measured: Errors, silent: Stretches) -> float:
    after = np.minimum(silent.last + 1, len(measured.time_ns) - 1)
    return float((measured.time_ns[after] - measured.time_ns[silent.first]).sum()) / NANOSECONDS


def _coverage(measured: Errors, valid: Flags) -> float:
    if valid.all():
        return 1.0
    column, row = np.floor(measured.instants.x / CELL_M), np.floor(measured.instants.y / CELL_M)
    _, cell = np.unique(column + 1j * row, return_inverse=True)
    answered = np.bincount(cell, weights=valid) / np.bincount(cell)
    return float(np.count_nonzero(answered >= COVERED) / len(answered))
