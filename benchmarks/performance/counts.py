"""Counts in place of times: calls of functions and instructions of Python by a message, and the size of a state.

They are the same every time on one version of Python, so a test may hold them to a bound. What a library does in C
shows in none of them.
"""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any, NamedTuple

import fusion
from benchmarks.performance.drive import STEPS_PER_SCAN, Drive, drive, site
from benchmarks.performance.implementation import EKF, Filter, Implementation, Subject
from benchmarks.performance.row import CALLS, INSTRUCTIONS, PUSH, PUSH_ESTIMATE, SCAN, STATE, Row

Count = Callable[[Callable[[], object]], int]


def calls(work: Callable[[], object]) -> int:
    """Number of functions that ``work`` calls, of Python or of C."""
    count = 0

    def profile(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal count
        count += event in {"call", "c_call"}

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        work()
    finally:
        sys.setprofile(before)
    return count


def instructions(work: Callable[[], object]) -> int:
    """Number of instructions of Python's own machine that ``work`` takes: loops within a function show here."""
    count = 0

    def trace(frame: FrameType, event: str, _argument: object) -> Any:  # noqa: ANN401 - a trace answers itself
        nonlocal count
        frame.f_trace_opcodes = True
        count += event == "opcode"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(before)
    return count


class Counted(NamedTuple):
    """The mean over the second half of a drive: by one odometry push, and by one scan."""

    push: float
    scan: float


def live_counts(implementation: Implementation, driven: Drive, count: Count = calls) -> Counted:
    """Those of an implementation on a drive."""
    made, blocks = implementation.start(driven), implementation.blocks(driven)
    half = len(blocks) // 2
    for steps, scan in blocks[:half]:
        made.move(steps)
        made.update(scan)
    each = [_of_block(made, *block, count) for block in blocks[half:]]
    pushes, scans = (sum(column) / len(each) for column in zip(*each, strict=True))
    return Counted(pushes / STEPS_PER_SCAN, scans)


def _of_block(made: Filter, steps: Sequence[object], scan: object, count: Count) -> tuple[int, int]:
    return count(lambda: made.move(steps)), count(lambda: made.update(scan))


def unused_anchor_instructions(more: int = 27) -> float:
    """Instructions of the ekf in one block, with an estimate after each message, by each anchor of the world that no
    scan holds.
    """
    few, many = (
        live_counts(EKF.live(estimates=True), drive(8.0, site(anchors)), instructions) for anchors in (3, 3 + more)
    )
    return (STEPS_PER_SCAN * (many.push - few.push) + many.scan - few.scan) / more


def state_bytes(subject: Subject, driven: Drive) -> int:
    """Size of an estimator's pickled state after the first epoch of a drive: what the host keeps of every epoch."""
    estimator = fusion.build(subject.estimator, driven.world, subject.options)
    timeline = fusion.Timeline(driven.world, driven.prior.time_ns)
    state = estimator.start(driven.prior, 0)
    for measurement in driven.blocks[0].measurements:
        for moment in timeline.push(measurement):
            for epoch in moment.epochs:
                state, _ = estimator.step(state, epoch.motion, epoch.scan)
    return len(pickle.dumps(state))


def count_rows() -> list[Row]:
    """The counts of the ekf."""
    driven = drive(8.0, site())
    on_demand, after_each = (live_counts(EKF.live(estimates=flag), driven) for flag in (False, True))
    found = {PUSH: on_demand.push, PUSH_ESTIMATE: after_each.push, SCAN: on_demand.scan}
    few, many = (state_bytes(EKF, drive(1.0, site(anchors))) for anchors in (3, 300))
    return [
        *(Row(CALLS, f"ekf: {what}", "calls", count) for what, count in found.items()),
        Row(INSTRUCTIONS, "ekf: 20 pushes with estimates and a scan", "instructions", unused_anchor_instructions()),
        Row(STATE, "ekf, 300 for 3", "bytes", many, ratio=many / few, against="3 anchors"),
    ]
