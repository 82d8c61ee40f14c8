"""The worst moments of an estimator, each with its causes: the state of estimates and readings just before."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.fates import REASONS, FateColumns
from benchmarks.metrics.matching import MAX_AGE_S
from benchmarks.review.drawing import Drawing
from benchmarks.review.error_causes import MISLEADING, Growth, growth, misreadings
from benchmarks.review.events import OWN_REFUSALS
from fusion import Decision, Odometry, Reason, Update, WheelTicks
from fusion.arrays import Flags, Floats, Stamps
from fusion.values import nanoseconds, seconds
from logs.run import Run

JUST_BEFORE_S = 5.0
"""Span before a moment in which causes are looked for."""
SILENCE_S = 2.0
"""A shorter gap in the readings is nothing unusual."""
ENOUGH_ANCHORS = 3
"""A position in the plane needs so many distances."""
TOGETHER_S = 1.0
"""Readings this close together count as one view of the anchors."""
SURPRISING_NIS = 9.0
"""Three standard deviations: a reading so far off that was believed all the same."""


class Moment(NamedTuple):
    """A local maximum of the position error [m], infinite where there was no valid answer, ``at_s`` after the run's
    start, with what was unusual just before, how the error grew in that time (None: not known), and what the error
    would have been at that moment [m] by what was done otherwise.
    """

    estimator: str
    at_s: float
    error_m: float
    causes: tuple[str, ...]
    growth: Growth | None = None
    otherwise: Mapping[str, float] = MappingProxyType({})


def worst_moments(
    run: Run, drawing: Drawing, start_ns: int, count: int, others: Sequence[Drawing] = ()
) -> list[Moment]:
    """The ``count`` worst moments of an estimator, the worst first; none where nothing is judged. ``others``: its
    counterfactuals, whose errors at those moments stand under their names.
    """
    if drawing.instants is None or drawing.score.errors is None:
        return []
    time_ns, errors_m = drawing.instants.time_ns, drawing.score.errors.position
    moments = []
    for place in peaks(time_ns, errors_m, count):
        at_ns = int(time_ns[place])
        recent = _updates_before(drawing, at_ns)
        causes = tuple(_causes(run, drawing, recent, at_ns)) or ("nothing unusual in the readings",)
        # Counterfactuals are scored against the same truth, so that their instants are the same.
        otherwise = {o.name: float(o.score.errors.position[place]) for o in others if o.score.errors is not None}
        what = (drawing.name, seconds(at_ns - start_ns), float(errors_m[place]), causes)
        moments.append(Moment(*what, growth(recent, drawing.instants), otherwise))
    return moments


def _updates_before(drawing: Drawing, at_ns: int) -> Sequence[Update]:
    """Those just before ``at_ns``."""
    span_ns = (at_ns - nanoseconds(JUST_BEFORE_S), at_ns)
    first, end = np.searchsorted(drawing.estimates.time_ns, span_ns, side="right").tolist()
    return drawing.final[first:end]


def _causes(run: Run, drawing: Drawing, recent: Sequence[Update], at_ns: int) -> Iterator[str]:
    """The causes just before ``at_ns``, in words."""
    yield from _of_estimates(drawing, at_ns)
    if drawing.gates:
        yield from _of_reception(drawing.fates, at_ns)
        yield from _of_judgement(drawing.fates, at_ns)
        yield from _of_truth(run, drawing, recent)
    else:
        yield "uses no radio"
    yield from _of_motion(run, at_ns)


def _of_estimates(drawing: Drawing, at_ns: int) -> Iterator[str]:
    estimates = drawing.estimates
    last = int(np.searchsorted(estimates.time_ns, at_ns, side="right")) - 1
    if last < 0:
        yield "no estimate yet"
        return
    if at_ns - estimates.time_ns[last] > nanoseconds(MAX_AGE_S):
        yield f"no estimate for {_length(at_ns - int(estimates.time_ns[last]))}"
    elif not estimates.valid[last]:
        yield "no valid position"
    first = int(np.searchsorted(estimates.time_ns, at_ns - nanoseconds(JUST_BEFORE_S), side="right"))
    resets = int(estimates.reset_count[last] - estimates.reset_count[min(first, last)])
    if resets > 0:
        yield f"belief replaced {resets} times" if resets > 1 else "belief replaced"


def _of_reception(fates: FateColumns, at_ns: int) -> Iterator[str]:
    """Silence, or too few anchors at once, among the readings that the host let through."""
    passed = fates.met(Decision.USED, Decision.DOWNWEIGHTED, Decision.REJECTED) | fates.met(*OWN_REFUSALS)
    time_ns, names = fates.time_ns[passed], fates.names[fates.source[passed]]
    end = int(np.searchsorted(time_ns, at_ns, side="right"))
    if end == 0:
        yield "no radio yet"
        return
    if at_ns - time_ns[end - 1] > nanoseconds(SILENCE_S):
        yield f"no radio for {_length(at_ns - int(time_ns[end - 1]))}"
        return
    since_ns = _last_view(time_ns[:end].tolist(), names[:end].tolist())
    if since_ns is None or at_ns - since_ns > nanoseconds(SILENCE_S):
        length = "so far" if since_ns is None else f"for {_length(at_ns - since_ns)}"
        yield f"fewer than {ENOUGH_ANCHORS} anchors {length}"


def _last_view(time_ns: list[int], names: list[str]) -> int | None:
    """The last time [ns] at which enough anchors had been received within `TOGETHER_S`, None: never."""
    within, start = Counter[str](), len(names)
    for end in range(len(names) - 1, -1, -1):
        while start > 0 and time_ns[start - 1] > time_ns[end] - nanoseconds(TOGETHER_S):
            start -= 1
            within[names[start]] += 1
        if len(+within) >= ENOUGH_ANCHORS:
            return time_ns[end]
        within[names[end]] -= 1
    return None


def _of_judgement(fates: FateColumns, at_ns: int) -> Iterator[str]:
    """Decisions on the readings just before."""
    recent = (fates.time_ns <= at_ns) & (fates.time_ns > at_ns - nanoseconds(JUST_BEFORE_S))
    recent &= ~fates.met(Reason.KIND_NOT_CONSUMED)
    total = int(recent.sum())
    for decision in (Decision.REJECTED, Decision.DOWNWEIGHTED, Decision.LATE, Decision.UNUSABLE):
        own = recent & fates.met(decision)
        # One reading in two: an outlier here and there is what a gate is for.
        if own.sum() * 2 >= max(total, 1):
            yield f"{own.sum()} of {total} readings {decision.value} ({_reasons(fates, own)})"
    taken = np.flatnonzero(recent & fates.met(Decision.USED) & (fates.nis > SURPRISING_NIS))
    if len(taken):
        worst = taken[np.argmax(fates.nis[taken])]
        yield f"{fates.names[fates.source[worst]]} taken with NIS {fates.nis[worst]:.1f}"


def _of_truth(run: Run, drawing: Drawing, recent: Sequence[Update]) -> Iterator[str]:
    """The anchor that misled most, and those that were right and not believed."""
    if drawing.instants is None:
        return
    judged = list(misreadings(run.world, recent, drawing.instants))
    misled = [one for one in judged if one.taken and one.sigmas >= MISLEADING]
    if misled:
        worst = max(misled, key=lambda one: one.sigmas)
        side = "farther" if worst.farther_m > 0.0 else "nearer"
        what = f"one reading of {worst.anchor}" if worst.alone else worst.anchor
        yield f"believed {what}, {abs(worst.farther_m):.2f} m {side} than it was ({worst.sigmas:.1f}σ)"
    taken = {one.anchor for one in judged if one.taken}
    right = [one.anchor for one in judged if one.sigmas < MISLEADING and one.anchor not in taken]
    if right:
        yield f"did not believe {', '.join(right)}, though right"


def _reasons(fates: FateColumns, chosen: Flags) -> str:
    return ", ".join(sorted({REASONS[code].value.replace("_", " ") for code in fates.reason[chosen].tolist()}))


def _of_motion(run: Run, at_ns: int) -> Iterator[str]:
    stamps = [m.time_ns for m in run.measurements if isinstance(m, WheelTicks | Odometry)]
    last_ns = max((stamp for stamp in stamps if stamp <= at_ns), default=None)
    if last_ns is None:
        yield "no odometry yet" if stamps else "no odometry in this run"
    elif at_ns - last_ns > nanoseconds(SILENCE_S):
        yield f"no odometry for {_length(at_ns - last_ns)}"


def _length(duration_ns: int) -> str:
    duration_s = seconds(duration_ns)
    return f"{duration_s:.0f} s" if duration_s >= 10.0 else f"{math.floor(10.0 * duration_s) / 10.0:g} s"


SPACING_S = 5.0
"""Moments closer together are one."""


def peaks(time_ns: Stamps, values: Floats, count: int) -> list[int]:
    """Indices of the ``count`` largest local maxima at least `SPACING_S` apart, the largest first, of equal ones the
    earliest; a plateau counts as its first row.
    """
    if len(values) == 0:
        return []
    starts = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))
    level = values[starts]
    above_left = np.concatenate([[True], level[1:] > level[:-1]])
    above_right = np.concatenate([level[:-1] > level[1:], [True]])
    chosen: list[int] = []
    candidates = starts[above_left & above_right]
    for place in candidates[np.argsort(-values[candidates], kind="stable")].tolist():
        if all(abs(int(time_ns[place]) - int(time_ns[other])) >= nanoseconds(SPACING_S) for other in chosen):
            chosen.append(place)
        if len(chosen) == count:
            break
    return chosen
