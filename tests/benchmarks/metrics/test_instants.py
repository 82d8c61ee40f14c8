"""Instants belong to the truth, matching is causal."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.matching import match
from fusion import Covariance, Decision, Estimate, Fate, Odometry, Pose, RangeReading, Ranges, Reason, Update
from fusion.timeline import order
from logs.truth import TruthTrack, evaluation_instants, interpolate_truth, known_truth

SECOND = 1_000_000_000


def truth_at(stamps_ns, x=None, heading=None):
    n = len(stamps_ns)
    return TruthTrack(
        np.array(stamps_ns, dtype=np.int64),
        np.arange(n, dtype=float) if x is None else np.array(x, dtype=float),
        np.zeros(n),
        np.zeros(n) if heading is None else np.array(heading, dtype=float),
    )


def update_at(time_ns, x=0.0, *, stamp_ns=None, fates=(), revised=False, covariance=None, **claims):
    estimate = Estimate(time_ns if stamp_ns is None else stamp_ns, Pose(x, 0.0, 0.0), covariance, **claims)
    return Update(Odometry(time_ns, "wheels", time_ns, time_ns - 1, 0.0, 0.0), estimate, fates, revised=revised)


def test_slow_truth_is_taken_at_its_own_stamps():
    stamps = [0, SECOND, 2 * SECOND, 9 * SECOND]
    assert evaluation_instants(truth_at(stamps)).time_ns.tolist() == stamps


def test_fast_truth_is_resampled_at_ten_hertz_and_never_extrapolated():
    stamps = np.arange(0, SECOND + 1, SECOND // 100) + 7
    instants = evaluation_instants(truth_at(stamps))
    assert instants.time_ns.tolist() == [7 + k * SECOND // 10 for k in range(11)]
    np.testing.assert_allclose(instants.x, np.arange(11) * 10.0, rtol=1e-12)


def test_instants_inside_a_long_gap_of_fast_truth_are_left_out():
    before = np.arange(0, SECOND + 1, SECOND // 20)
    after = before + 3 * SECOND
    instants = evaluation_instants(truth_at(np.concatenate([before, after])))
    inside = (instants.time_ns > SECOND) & (instants.time_ns < 3 * SECOND)
    assert not inside.any()
    assert len(instants.time_ns) == 22


def test_heading_is_interpolated_along_the_shortest_arc():
    stamps = np.array([0, 40, 80, 120, 160, 200]) * 1_000_000
    instants = evaluation_instants(truth_at(stamps, heading=[3.1, 3.1, 3.1, -3.1, -3.1, -3.1]))
    assert abs(instants.heading[1]) == pytest.approx(math.pi, rel=1e-12)


def test_unknown_heading_of_a_neighbour_does_not_spoil_a_known_one():
    instants = evaluation_instants(truth_at(np.arange(3) * SECOND // 10, heading=[0.5, math.nan, 0.7]))
    np.testing.assert_array_equal(instants.heading, [0.5, math.nan, 0.7])


def test_heading_between_two_stamps_is_known_only_if_both_are():
    known = known_truth(truth_at(np.arange(4) * SECOND, heading=[0.5, 0.7, math.nan, 0.9]))
    between, kept = interpolate_truth(known, np.array([SECOND // 2, 3 * SECOND // 2, 5 * SECOND // 2]), gap_s=2.0)
    np.testing.assert_allclose(between.heading, [0.6, math.nan, math.nan])
    assert kept.all()
    assert np.isfinite(between.x).all()


def test_truth_that_is_nowhere_finite_gives_no_instants():
    assert len(evaluation_instants(truth_at([0, 1], x=[math.nan, math.inf])).time_ns) == 0


def test_an_answer_of_exactly_the_greatest_age_is_valid_and_a_nanosecond_more_is_not():
    instants = evaluation_instants(truth_at([SECOND, SECOND + 1]), hz=1e9)
    assert match(instants, Track.of([update_at(0)])).valid.tolist() == [True, False]


def test_no_answer_comes_from_the_future():
    instants = evaluation_instants(truth_at([0, SECOND]))
    answers = match(instants, Track.of([update_at(1, 5.0), update_at(SECOND, 6.0), update_at(SECOND + 1, 7.0)]))
    assert answers.valid.tolist() == [False, True]
    assert answers.x[1] == 6.0


def test_an_answer_about_a_time_to_come_counts_only_once_that_has_come():
    """Of a clock half a second ahead: received at once, it neither counts early nor holds up what follows."""
    instants = evaluation_instants(truth_at([10, 20, 30]), hz=1e9)
    ahead = [update_at(5, 1.0), update_at(25, 2.0), update_at(10, 3.0)]
    track = Track.of(ahead, {order(ahead[1].measurement): 6})
    assert track.received_ns.tolist() == [5, 6, 10]
    assert match(instants, track).x.tolist() == [3.0, 3.0, 2.0]


def test_an_answer_about_the_past_counts_only_once_it_was_received():
    instants = evaluation_instants(truth_at([SECOND, 2 * SECOND]))
    answers = match(instants, Track.of([update_at(2 * SECOND, 5.0, stamp_ns=SECOND)]))
    assert answers.valid.tolist() == [False, True]


def test_a_late_message_replaces_the_newest_answer_only_by_its_revision():
    instants = evaluation_instants(truth_at([10, 20]), hz=1e9)
    late = [update_at(10, 1.0), update_at(5, 2.0), update_at(10, 3.0, revised=True)]
    assert match(instants, Track.of(late)).x.tolist() == [3.0, 3.0]


def test_a_refused_clock_does_not_move_the_time_of_reception():
    bad = Fate(SECOND * 10**6, "wheels", 0, "", Decision.UNUSABLE, Reason.BAD_CLOCK, 0.0)
    updates = [update_at(10), update_at(SECOND * 10**6, stamp_ns=10, fates=(bad,)), update_at(20)]
    assert Track.of(updates).received_ns.tolist() == [10, 10, 20]


def test_answers_not_claimed_or_not_finite_are_not_valid():
    instants = evaluation_instants(truth_at([10]))
    assert not match(instants, Track.of([update_at(10, math.nan)])).valid[0]
    assert not match(instants, Track.of([update_at(10, valid=False)])).valid[0]
    assert not match(instants, Track.of([])).valid[0]
    assert math.isnan(match(instants, Track.of([update_at(10, heading_known=False)])).heading[0])


def test_track_with_an_answer_that_is_no_number_has_no_answer_at_all():
    instants = evaluation_instants(truth_at(np.arange(4) * SECOND))
    sound = [update_at(k * SECOND, 1.0) for k in range(4)]
    assert match(instants, Track.of(sound)).valid.all()
    spoilt = Track.of([*sound[:2], update_at(2 * SECOND, math.nan), sound[3]])
    assert not match(instants, spoilt).valid.any()
    assert spoilt.flaw.startswith("it answers x nan m, y ")
    assert ", 2 s after its first answer" in spoilt.flaw
    unclaimed = Track.of([*sound[:2], update_at(2 * SECOND, math.nan, valid=False), sound[3]])
    assert match(instants, unclaimed).valid.tolist() == [True, True, False, True]


def _claiming(covariance, **claimed):
    update = update_at(SECOND)
    claim = update.estimate._replace(covariance=covariance, **claimed)
    return Track.of([Update(update.measurement, claim, update.fates)])


def test_covariance_that_is_no_number_is_a_flaw_and_one_that_is_not_claimed_is_none():
    sound, nothing = Covariance.from_std(0.1, 0.1, 0.1), Covariance(*[math.nan] * 6)
    headless = sound._replace(xh=math.nan, yh=math.nan, hh=math.nan)
    assert _claiming(nothing).flaw.startswith("it answers a covariance of NaN, 0 s after")
    assert _claiming(sound._replace(xy=math.nan)).flaw
    assert _claiming(headless).flaw
    for covariance, claimed in (
        (None, {}),
        (sound, {}),
        (headless, {"heading_known": False}),
        (nothing, {"valid": False}),
    ):
        assert _claiming(covariance, **claimed).flaw == ""


def test_age_is_that_of_the_newest_answer_and_infinite_before_the_first():
    instants = evaluation_instants(truth_at([0, SECOND, 3 * SECOND]))
    answers = match(instants, Track.of([update_at(SECOND // 2), update_at(SECOND, stamp_ns=3 * SECOND // 4)]))
    assert answers.age_s.tolist() == [math.inf, 0.25, 2.25]
    assert match(instants, Track.of([])).age_s.tolist() == [math.inf] * 3


def ranges_at(time_ns, decision, weight):
    fate = Fate(time_ns, "uwb", time_ns, "a", decision, Reason.OK, weight)
    ranges = Ranges(time_ns, "uwb", time_ns, (RangeReading("a", 1.0),))
    return Update(ranges, update_at(time_ns).estimate, (fate,))


def test_time_since_the_last_fix_counts_from_radio_that_was_believed():
    instants = evaluation_instants(truth_at([0, 2 * SECOND, 4 * SECOND, 6 * SECOND, 8 * SECOND]))
    gyro = Fate(7 * SECOND, "gyro", 0, "", Decision.USED, Reason.OK, 1.0)
    updates = [
        ranges_at(SECOND, Decision.USED, 1.0),
        ranges_at(3 * SECOND, Decision.REJECTED, 0.0),
        ranges_at(5 * SECOND, Decision.DOWNWEIGHTED, 0.3),
        update_at(7 * SECOND, fates=(gyro,)),
    ]
    since = match(instants, Track.of(updates)).since_fix_s
    np.testing.assert_array_equal(since, [math.nan, 1.0, 3.0, 1.0, 3.0])
    assert np.isnan(match(instants, Track.of(updates[1:2])).since_fix_s).all()


def test_track_alone_is_matched_as_its_updates_were():
    claimed = Covariance(1.0, 0.1, 0.2, 2.0, 0.3, 3.0)
    updates = [update_at(k * SECOND, float(k)) for k in (0, 1, 1, 3)]
    updates[1] = update_at(SECOND, 1.0, covariance=claimed, valid=False)
    instants = evaluation_instants(truth_at(np.arange(-1, 6) * SECOND))
    by_updates = match(instants, Track.of(updates))
    by_track = match(instants, Track.of_estimates([update.estimate for update in updates]))
    for column, other in zip(by_updates, by_track, strict=True):
        np.testing.assert_array_equal(column, other)
    np.testing.assert_array_equal(Track.of_estimates([updates[1].estimate]).covariance[0], claimed)


@settings(derandomize=True, max_examples=50)
@given(st.lists(st.integers(0, 40), min_size=1, max_size=20), st.lists(st.integers(0, 50), min_size=1, unique=True))
def test_matching_agrees_with_its_definition(arrivals, asked):
    updates = [update_at(time_ns, float(i)) for i, time_ns in enumerate(arrivals)]
    instants = evaluation_instants(truth_at(sorted(asked)), hz=1e9)
    answers = match(instants, Track.of(updates), max_age_s=10e-9)
    for t, valid, x in zip(instants.time_ns, answers.valid, answers.x, strict=True):
        received = [u for i, u in enumerate(updates) if max(arrivals[: i + 1]) <= t]
        newest = max(received, key=lambda u: (u.estimate.time_ns, u.estimate.pose.x), default=None)
        assert valid == (newest is not None and t - newest.estimate.time_ns <= 10)
        if newest is not None:
            assert x == newest.estimate.pose.x
