"""Whatever order measurements arrive in, the run is that of arrival in order, to the bit."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusion import Decision, Gyro, Increment, Odometry, Reason, digest, final
from fusion.epochs import Longest
from fusion.fold import Fold
from fusion.timeline import HORIZON_S, Timeline, order
from fusion.tracker import Tracker
from tests.fusion.streams import (
    MILLISECOND,
    PRIOR,
    SECOND,
    WORLD,
    Ledger,
    epochs_of,
    last_words,
    late_streams,
    moments_of,
    odometry,
    ranges,
    streams,
)

SHORT = Longest(path_m=0.6, turn_rad=2.5, duration_s=0.7)
STEADY = [odometry(k) for k in range(1, 41)]
"""Four seconds at 10 Hz."""


def with_scans(*stamps_ms):
    return sorted([*STEADY, *(ranges(ms * MILLISECOND, ms) for ms in stamps_ms)], key=order)


def followed(measurements):
    """A ledger's state, and its updates, after measurements in that order of arrival."""
    tracker = Tracker(Ledger(), WORLD, PRIOR)
    updates = [update for measurement in measurements for update in tracker.push(measurement)]
    return tracker.particles(), updates


def test_order_is_time_then_motion_before_radio_then_sensor_then_number():
    at_one = [
        Gyro(SECOND, "gyro", 3, 0.0),
        replace(odometry(10), seq=1),
        replace(odometry(10), seq=2),
        ranges(SECOND, 0),
        ranges(SECOND, 1),
    ]
    assert sorted([*reversed(at_one), odometry(9)], key=order) == [odometry(9), *at_one]
    assert order(ranges(SECOND, 7)) == (SECOND, 1, "uwb", 7)


def test_moments_of_arrival_in_order_are_one_each_and_count_the_epochs():
    moments = moments_of(with_scans(1000, 2000))
    assert [moment.measurement for moment in moments] == with_scans(1000, 2000)
    assert [(m.time_ns // MILLISECOND, m.first) for m in moments if m.epochs] == [(1000, 0), (2000, 1)]
    assert all(moment.fates == () and not moment.revised for moment in moments)
    assert [moment.first for moment in moments[-20:]] == [2] * 20
    assert moments[-1].motion.duration_s == pytest.approx(2.0)


@pytest.mark.parametrize("late_ms", [50, 500, 1900])
def test_late_odometry_is_put_in_its_place_and_what_follows_made_again(late_ms):
    """The increment that ends at 2 s comes after scans that stand behind it."""
    in_order = with_scans(1000, 2050, 2500, 3950)
    late = next(m for m in in_order if m.time_ns == 2 * SECOND)
    arrived = [m for m in in_order if m is not late]
    place = next(i for i, m in enumerate(arrived) if m.time_ns > 2 * SECOND + late_ms * MILLISECOND)
    arrived.insert(place, late)
    moments = moments_of(arrived)
    own = next(i for i, moment in enumerate(moments) if moment.measurement is late)
    again = [moment for moment in moments if moment.revised]
    assert not moments[own].revised
    assert [moment.measurement for moment in again] == [m for m in arrived[:place] if m.time_ns > late.time_ns]
    assert moments[own + 1 : own + 1 + len(again)] == again
    assert repr(epochs_of(moments)) == repr(epochs_of(moments_of(in_order)))


def test_epoch_before_the_late_odometry_held_its_motion_and_has_it_measured_afterwards():
    """A robot that stopped: up to the scan at 2.05 s the twist of 1.9 s was held."""
    stopped = replace(odometry(20), distance_m=0.0)
    scan = ranges(2050 * MILLISECOND)
    moments = moments_of([odometry(19), scan, stopped])
    before, after = (moment.epochs[0].motion for moment in moments if moment.epochs)
    assert before.path_m == pytest.approx(0.05 + 0.5 * 0.15)
    assert after.path_m == pytest.approx(0.05)


def test_late_radio_is_put_in_its_place_and_splits_the_motion_there():
    in_order = with_scans(1000, 2000, 3000)
    late = ranges(2 * SECOND, 2000)
    arrived = [m for m in in_order if m != late]
    arrived.insert(arrived.index(ranges(3 * SECOND, 3000)) + 1, late)
    moments = moments_of(arrived)
    whole, own, rest = (
        [e.motion.duration_s for e in m.epochs] for m in moments if m.epochs and m.time_ns >= 2 * SECOND
    )
    assert (whole, own, rest) == (pytest.approx([2.0]), pytest.approx([1.0]), pytest.approx([1.0]))
    assert repr(epochs_of(moments)) == repr(epochs_of(moments_of(in_order)))


@given(late_streams())
def test_late_inside_the_horizon_gives_states_updates_and_digest_of_arrival_in_order(stream):
    in_order, arrived = stream
    state, updates = followed(in_order)
    late_state, late_updates = followed(arrived)
    assert repr(late_state) == repr(state)
    assert repr(last_words(late_updates)) == repr(last_words(updates))
    assert digest(final(late_updates)) == digest(final(updates))


@given(late_streams())
def test_what_is_settled_is_never_touched_again(stream):
    settled, count = 0, 0
    for moment in moments_of(stream[1], longest=SHORT):
        assert settled <= moment.first <= count
        assert settled <= moment.settled <= moment.first + len(moment.epochs)
        settled, count = moment.settled, moment.first + len(moment.epochs)


@given(late_streams(), st.integers(-SECOND, 5 * SECOND))
def test_asking_for_the_motion_held_changes_nothing(stream, ahead_ns):
    asked, alone = (Timeline(WORLD, 0, longest=SHORT) for _ in range(2))
    for measurement in stream[1]:
        assert repr(asked.push(measurement)) == repr(alone.push(measurement))
        asked.held(asked.time_ns + ahead_ns)


@given(streams())
def test_motion_of_a_moment_is_what_follows_its_last_epoch(stream):
    """A scan's own is none; and what is held is at least as long."""
    timeline = Timeline(WORLD, 0, longest=SHORT)
    for measurement in stream:
        (moment,) = timeline.push(measurement)
        assert moment.time_ns == timeline.time_ns == measurement.time_ns
        if moment.epochs and moment.epochs[-1].scan is not None:
            assert moment.motion == Increment(time_ns=moment.time_ns)
        held = timeline.held(moment.time_ns)
        assert held.time_ns <= moment.time_ns
        assert held.duration_s >= moment.motion.duration_s


@pytest.mark.parametrize(
    ("measurement", "decision", "reason"),
    [
        pytest.param(ranges(1999 * MILLISECOND), Decision.LATE, Reason.TOO_LATE, id="radio beyond the horizon"),
        pytest.param(Gyro(SECOND, "gyro", 0, 0.0), Decision.LATE, Reason.TOO_LATE, id="motion beyond the horizon"),
        pytest.param(STEADY[-1], Decision.UNUSABLE, Reason.DUPLICATE, id="the newest again"),
        pytest.param(STEADY[25], Decision.UNUSABLE, Reason.DUPLICATE, id="an older one again"),
        pytest.param(ranges(4000 * SECOND), Decision.UNUSABLE, Reason.BAD_CLOCK, id="more than an hour ahead"),
    ],
)
def test_measurement_that_is_kept_out_has_fates_and_changes_nothing(measurement, decision, reason):
    timeline, untouched = Timeline(WORLD, 0), Timeline(WORLD, 0)
    for one in STEADY:
        timeline.push(one)
        untouched.push(one)
    (moment,) = timeline.push(measurement)
    anchors = ["a", "b", "c"] if hasattr(measurement, "readings") else [""]
    assert [(f.anchor, f.decision, f.reason) for f in moment.fates] == [(a, decision, reason) for a in anchors]
    assert (moment.epochs, moment.time_ns, moment.first) == ((), 4 * SECOND, 0)
    assert repr(timeline.held(5 * SECOND)) == repr(untouched.held(5 * SECOND))
    after = odometry(41)
    assert repr(timeline.push(after)) == repr(untouched.push(after))


def test_last_moment_inside_the_horizon_is_still_taken():
    timeline = Timeline(WORLD, 0)
    for one in STEADY:
        timeline.push(one)
    horizon_ns = int(HORIZON_S * SECOND)
    own, *again = timeline.push(ranges(4 * SECOND - horizon_ns))
    assert len(own.epochs) == 1
    assert len(again) == 20


def test_clock_that_two_measurements_agree_on_is_believed():
    timeline = Timeline(WORLD, 0)
    timeline.push(STEADY[0])
    (first,) = timeline.push(ranges(4000 * SECOND, 1))
    (second,) = timeline.push(ranges(4001 * SECOND, 2))
    assert [fate.reason for fate in first.fates] == [Reason.BAD_CLOCK] * 3
    assert second.fates == ()
    assert timeline.time_ns == 4001 * SECOND


def test_two_wrong_clocks_that_disagree_are_both_refused():
    timeline = Timeline(WORLD, 0)
    for time_ns in (10_000 * SECOND, 20_000 * SECOND, 30_000 * SECOND):
        (moment,) = timeline.push(ranges(time_ns))
        assert {fate.reason for fate in moment.fates} == {Reason.BAD_CLOCK}
    assert timeline.time_ns == 0


def test_radio_at_the_very_start_counts_and_motion_that_ends_there_does_not():
    over, scan = Odometry(0, "wheels", 0, -SECOND, 1.0, 0.0), ranges(0)
    timeline = Timeline(WORLD, 0)
    (moment,) = timeline.push(over)
    assert [(f.decision, f.reason) for f in moment.fates] == [(Decision.LATE, Reason.TOO_LATE)]
    (moment,) = timeline.push(scan)
    assert [epoch.scan for epoch in moment.epochs] == [scan]


def test_horizon_of_none_takes_only_what_comes_in_order():
    timeline = Timeline(WORLD, 0, horizon_s=0.0)
    timeline.push(odometry(2))
    (moment,) = timeline.push(ranges(SECOND // 10))
    assert {fate.decision for fate in moment.fates} == {Decision.LATE}


def test_states_of_a_fold_follow_a_timeline_that_is_revised():
    """A scan too late by half a second: the state after it is that of arrival in order, without asking."""
    in_order = with_scans(1000, 2000, 2400)
    arrived = [m for m in in_order if m.time_ns != 2 * SECOND or not hasattr(m, "readings")]
    arrived.insert(26, ranges(2 * SECOND, 2000))
    timeline, fold = Timeline(WORLD, 0), Fold(Ledger(), PRIOR)
    for measurement in arrived:
        for moment in timeline.push(measurement):
            fold.take(moment)
    assert arrived != in_order
    assert repr(fold.particles()) == repr(followed(in_order)[0])
