"""States and events of an estimator, derived from its estimates and fates."""

import numpy as np

from benchmarks.metrics.fates import FateColumns, fates_per_update
from benchmarks.review.columns import EstimateColumns
from benchmarks.review.events import State, events, states
from fusion import Decision, Estimate, Fate, Pose, Reason, RssiReading, Update, WifiScan

SECOND_NS = 1_000_000_000
TAKEN, GATED = (Decision.USED, Reason.OK), (Decision.REJECTED, Reason.GATE)
TOO_FEW = (Decision.UNUSABLE, Reason.TOO_FEW_ANCHORS)
FOREIGN = (Decision.UNUSABLE, Reason.UNKNOWN_ANCHOR)
IGNORED = (Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED)


def update(second, *judgements, nis=None, **claims):
    """One scan at that second, a reading for each judgement, and what the estimate claims."""
    stamp = second * SECOND_NS
    names = [f"ap{i}" for i in range(len(judgements))]
    scan = WifiScan(stamp, "wifi", second, tuple(RssiReading(name, -50.0) for name in names))
    fates = [Fate(stamp, "wifi", second, n, *j, 1.0, nis=nis) for n, j in zip(names, judgements, strict=True)]
    return Update(scan, Estimate(stamp, Pose(0.0, 0.0, 0.0), None, **claims), tuple(fates))


def told_states(*updates):
    fate_update = np.repeat(np.arange(len(updates)), fates_per_update(updates))
    changes = states(EstimateColumns.of_updates(updates), FateColumns.of(updates), fate_update)
    return list(zip((changes.time_ns // SECOND_NS).tolist(), changes.state, strict=True))


def told_events(*updates):
    happened = events(updates, EstimateColumns.of_updates(updates), FateColumns.of(updates))
    return list(zip((happened.time_ns // SECOND_NS).tolist(), happened.level, happened.text, strict=True))


def test_one_reading_taken_is_accept_and_none_taken_is_reject():
    updates = (
        update(1),
        update(2, TAKEN, GATED),
        update(3, GATED, GATED),
        update(4),
        update(5, TOO_FEW),
        update(6, TAKEN),
    )
    assert told_states(*updates) == [(1, State.INIT), (2, State.ACCEPT), (3, State.REJECT), (6, State.ACCEPT)]


def test_estimator_without_a_position_is_init_at_first_and_lost_later():
    updates = update(1, TAKEN, valid=False), update(2, TAKEN), update(3, TAKEN, valid=False), update(4, TAKEN)
    assert told_states(*updates) == [(1, State.INIT), (2, State.ACCEPT), (3, State.LOST), (4, State.ACCEPT)]


def test_estimator_that_reports_it_is_lost_is_lost():
    assert told_states(update(1, TAKEN, p_lost=0.2), update(2, TAKEN, p_lost=0.9)) == [
        (1, State.ACCEPT),
        (2, State.LOST),
    ]


def test_method_without_radio_has_no_states_and_no_events():
    assert told_states(update(1, IGNORED), update(2, IGNORED)) == []
    assert told_events(update(1, IGNORED), update(2, IGNORED)) == []
    assert told_states() == []


def test_what_the_host_refuses_is_an_event_and_no_state_of_the_estimator():
    updates = update(1, TAKEN), update(2, FOREIGN)
    assert told_states(*updates) == [(1, State.ACCEPT)]
    assert told_events(*updates) == [(2, "INFO", "ap0 unusable: unknown anchor")]


def test_rejected_readings_are_warnings_with_their_nis():
    assert told_events(update(3, GATED, nis=18.52)) == [(3, "WARN", "ap0 rejected: gate, NIS 18.5")]


def test_late_readings_are_reported():
    late = update(2, (Decision.LATE, Reason.TOO_LATE))
    assert told_events(late) == [(2, "INFO", "ap0 late: too late")]


def test_resets_and_losses_are_reported_once_each():
    jump = {"reset_count": 1, "reset_delta": Pose(3.0, 4.0, 0.0)}
    updates = update(1), update(2, valid=False), update(3, valid=False), update(4, **jump), update(5, **jump)
    assert told_events(*updates) == [
        (2, "ERROR", "no valid position"),
        (4, "INFO", "position valid again"),
        (4, "WARN", "belief replaced (reset 1), moved by 5.00 m"),
    ]
