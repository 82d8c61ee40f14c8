"""The gate against slower code, without a clock: calls and instructions by a message, the same on every machine.

Bounds are a little above what the code takes now, under Python 3.11; lower them with it.
"""

import pytest

from benchmarks.performance.cost_laws import refold_rows
from benchmarks.performance.counts import calls, instructions, live_counts, state_bytes, unused_anchor_instructions
from benchmarks.performance.drive import drive, site
from benchmarks.performance.implementation import DEAD_RECKONING, DYNAMIC_WEIGHT, EKF, PARTICLE

MOST_CALLS = {
    EKF: ((34, 415), (77, 430)),
    PARTICLE: ((34, 550), (64, 575)),
    DYNAMIC_WEIGHT: ((34, 432), (75, 466)),
    DEAD_RECKONING: ((34, 172), (92, 224)),
}
"""By one odometry push and by one scan of 3 ranges: with estimates on demand, and with one after each."""
MOST_INSTRUCTIONS_BY_UNUSED_ANCHOR = 1
MOST_STEPS_BY_LATE_SCAN = 8
MOST_STATE_BYTES = 1300
"""Of the ekf in a world of 300 anchors, 3 of which were received."""


@pytest.mark.parametrize("estimates", [False, True], ids=["on demand", "after each"])
@pytest.mark.parametrize("subject", MOST_CALLS, ids=lambda subject: subject.estimator)
def test_push_and_scan_call_no_more_functions_than_they_did(subject, estimates):
    counted = live_counts(subject.live(estimates=estimates), drive(8.0, site()))
    push, scan = MOST_CALLS[subject][estimates]
    assert counted.push <= push
    assert counted.scan <= scan


def test_anchor_that_is_never_received_costs_no_more_than_it_did():
    assert unused_anchor_instructions() <= MOST_INSTRUCTIONS_BY_UNUSED_ANCHOR


def test_state_holds_no_more_of_anchors_that_are_never_received_than_it_did():
    assert state_bytes(EKF, drive(1.0, site(300))) <= MOST_STATE_BYTES


def test_late_scan_makes_no_more_steps_again_than_it_did():
    (row,) = refold_rows()
    assert 1 <= row.value <= MOST_STEPS_BY_LATE_SCAN


def test_calls_are_counted_whether_of_python_or_of_c():
    def python():
        return len("ab")

    def twice():
        return python(), python()

    assert calls(python) == calls(lambda: None) + 1
    assert calls(twice) == calls(lambda: None) + 4


def test_instructions_show_a_loop_that_calls_nothing():
    def loop(times):
        return [k for k in range(times) if k == -1]

    once, more, most = (instructions(lambda n=n: loop(n)) for n in (1, 11, 21))
    assert most - more == more - once > 10 * 2


def test_counts_are_the_same_every_time():
    driven = drive(4.0, site())
    for count in (calls, instructions):
        first, second = (live_counts(EKF.live(estimates=True), driven, count) for _ in range(2))
        assert first == second
