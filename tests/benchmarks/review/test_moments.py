"""Where an estimator was worst, and the causes that are listed."""

import dataclasses
import shlex

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fusion
from benchmarks.review.drawing import drawings
from benchmarks.review.error_causes import Growth
from benchmarks.review.folding import Reviewed
from benchmarks.review.moments import SPACING_S, Moment, peaks, worst_moments
from benchmarks.runner.estimator_run import EstimatorRun
from benchmarks.runner.review_command import review_command
from fusion import Decision, Estimate, Fate, Odometry, Pose, RangeReading, Ranges, Reason, Truth, Update
from fusion.cli.options import parse_settings
from logs.run import Run
from logs.truth import TruthTrack

SECOND_NS = 1_000_000_000
WORLD = fusion.World.from_table(
    {"name": "w", "anchors": [{"id": n, "position_m": [i, i * i]} for i, n in enumerate("abc")]}
)
RANGE_M = {anchor.id: float(np.hypot(anchor.x, anchor.y)) for anchor in WORLD.anchors}
"""What is measured at the origin, where the truth is."""
TAKEN, GATED = (Decision.USED, Reason.OK), (Decision.REJECTED, Reason.GATE)
LENGTH_S = 40


def stamps(count):
    return np.arange(count) * SECOND_NS


def test_peaks_are_local_maxima_the_largest_first():
    values = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0])
    assert peaks(stamps(14), values, 9) == [7, 13, 1]
    assert peaks(stamps(14), values, 2) == [7, 13]


def test_of_peaks_closer_than_the_spacing_the_larger_stays():
    assert peaks(stamps(8), np.array([0.0, 4.0, 0.0, 5.0, 0.0, 0.0, 3.0, 0.0]), 9) == [3]


def test_an_outage_is_one_peak_at_its_beginning():
    values = np.full(30, 0.1)
    values[10:20] = np.inf
    assert peaks(stamps(30), values, 1) == [10]


def test_no_values_have_no_peak_and_a_constant_has_one():
    assert peaks(stamps(0), np.array([]), 3) == []
    assert peaks(stamps(9), np.ones(9), 3) == [0]


@settings(derandomize=True)
@given(st.lists(st.floats(0.0, 9.0) | st.just(np.inf), min_size=1, max_size=60), st.integers(1, 5))
def test_peaks_hold_the_maximum_and_keep_their_distance(values, count):
    found = peaks(stamps(len(values)), np.array(values), count)
    assert values[found[0]] == max(values)
    assert len(found) <= count
    assert all(abs(a - b) >= SPACING_S for i, a in enumerate(found) for b in found[:i])


def moment_of(tmp_path, judge, *, odometry=lambda _: True, off_m=lambda *_: 0.0, **claims):
    """The worst moment of an estimator whose error peaks at 30 s; ``judge`` gives (anchor, decision, reason, NIS) rows
    for each second, empty for no scan; ``off_m``: how wrong a reading is, by second and anchor.
    """
    truth = [Truth(s * SECOND_NS, 0.0, 0.0, 0.0) for s in range(LENGTH_S)]
    updates = []
    for s in range(LENGTH_S):
        stamp, error = s * SECOND_NS, 1.0 + (5.0 if s == 30 else 0.0)
        estimate = Estimate(stamp, Pose(error, 0.0, 0.0), None, **{key: value(s) for key, value in claims.items()})
        if odometry(s):
            updates.append(Update(Odometry(stamp, "wheels", s, stamp - SECOND_NS, 0.0, 0.0), estimate, ()))
        if judged := judge(s):
            ranges = Ranges(stamp, "uwb", s, tuple(RangeReading(a, RANGE_M[a] + off_m(s, a)) for a, *_ in judged))
            fates = (Fate(stamp, "uwb", s, a, decision, reason, 1.0, nis=nis) for a, decision, reason, nis in judged)
            updates.append(Update(ranges, estimate, tuple(fates)))
    measurements = tuple(update.measurement for update in updates)
    track = TruthTrack.from_truths(truth)
    run = Run(tmp_path / "a run.mcap", "run", WORLD, None, {}, measurements, track, (), {})
    (drawing,) = drawings(run, [Reviewed.of(run, EstimatorRun("toy", tuple(updates)))])
    (moment,) = worst_moments(run, drawing, 0, 1)
    return moment


def all_taken(second, nis=1.0):
    return [(anchor, *TAKEN, nis) for anchor in "abc"]


def test_quiet_moment_has_time_error_and_no_cause(tmp_path):
    moment = moment_of(tmp_path, all_taken)
    assert moment == Moment("toy", 30.0, 6.0, ("nothing unusual in the readings",), Growth(1.0, 0.0, 5.0))


def test_rejected_readings_are_counted_over_the_seconds_before(tmp_path):
    moment = moment_of(tmp_path, lambda s: [(a, *GATED, 20.0) for a in "abc"] if s > 27 else all_taken(s))
    assert moment.causes[0] == "9 of 15 readings rejected (gate)"


def test_single_rejected_reading_is_no_cause(tmp_path):
    moment = moment_of(
        tmp_path, lambda s: [("a", *(GATED if s == 29 else TAKEN), 1.0), ("b", *TAKEN, 1.0), ("c", *TAKEN, 1.0)]
    )
    assert moment.causes == ("nothing unusual in the readings",)


def test_too_few_anchors_are_reported_with_their_time(tmp_path):
    moment = moment_of(tmp_path, lambda s: all_taken(s)[: 2 if s > 26 else 3])
    assert moment.causes == ("fewer than 3 anchors for 4 s",)


def test_anchors_received_one_after_the_other_within_a_second_count_together(tmp_path):
    truth = [Truth(k * SECOND_NS // 4, 0.0, 0.0, 0.0) for k in range(200)]
    assert "fewer" not in " ".join(one_anchor_at_a_time(tmp_path, truth).causes)


def one_anchor_at_a_time(tmp_path, truth):
    updates = []
    for k, pose in enumerate(truth):
        ranges = Ranges(pose.time_ns, "uwb", k, (RangeReading("abc"[k % 3], RANGE_M["abc"[k % 3]]),))
        fate = Fate(pose.time_ns, "uwb", k, "abc"[k % 3], *TAKEN, 1.0)
        updates.append(Update(ranges, Estimate(pose.time_ns, Pose(k % 100 / 10, 0.0, 0.0), None), (fate,)))
    run = Run(
        tmp_path, "r", WORLD, None, {}, tuple(u.measurement for u in updates), TruthTrack.from_truths(truth), (), {}
    )
    (drawing,) = drawings(run, [Reviewed.of(run, EstimatorRun("toy", tuple(updates)))])
    return worst_moments(run, drawing, 0, 1)[0]


def test_silence_of_the_radio_and_of_the_odometry_are_reported(tmp_path):
    moment = moment_of(tmp_path, lambda s: [] if 20 < s <= 30 else all_taken(s))
    assert moment.causes == ("no radio for 10 s",)
    moment = moment_of(tmp_path, all_taken, odometry=lambda s: not 26 < s <= 30)
    assert moment.causes == ("no odometry for 4 s",)


def test_believed_reading_far_off_is_named(tmp_path):
    moment = moment_of(tmp_path, lambda s: [("a", *TAKEN, 30.0 if s == 29 else 1.0), *all_taken(s)[1:]])
    assert moment.causes == ("a taken with NIS 30.0",)


def test_reset_and_missing_position_are_reported(tmp_path):
    assert moment_of(tmp_path, all_taken, reset_count=lambda s: int(s > 28)).causes == ("belief replaced",)
    outage = moment_of(tmp_path, all_taken, valid=lambda s: s != 35)
    assert (outage.at_s, outage.error_m) == (35.0, np.inf)
    assert "no valid position" in outage.causes


def test_method_without_radio_is_named_as_such(tmp_path):
    ignored = Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED
    moment = moment_of(tmp_path, lambda s: [(anchor, *ignored, None) for anchor in "abc"])
    assert moment.causes == ("uses no radio",)
    late = Decision.LATE, Reason.TOO_LATE
    moment = moment_of(tmp_path, lambda s: [("a", *(ignored if s else late), None), ("b", *ignored, None)])
    assert moment.causes == ("uses no radio",)


def test_command_can_be_pasted_and_names_parameters_and_a_seed_that_matters(tmp_path):
    run = tmp_path / "a run.mcap"
    words = shlex.split(review_command([str(run)], "ekf", 30.0))
    assert words == ["fusion", "review", str(run), "--estimators", "ekf", "--at", "30.00"]
    words = shlex.split(
        review_command([str(run)], "ekf", 30.0, params={"gate_probability": 0.9, "mode": "fast"}, seed=7)
    )
    assert words[7:9] == ["--set", "ekf.gate_probability=0.9"]
    assert parse_settings(words[8:11:2]) == {"ekf": {"gate_probability": 0.9, "mode": "fast"}}
    assert words[-2:] == ["--seed", "7"]


def test_lane_that_crashed_has_no_moments(tmp_path):
    track = TruthTrack.from_truths([Truth(0, 0.0, 0.0, 0.0)])
    run = Run(tmp_path, "r", WORLD, None, {}, (), track, (), {})
    (drawing,) = drawings(run, [Reviewed.of(run, EstimatorRun("toy", error="on purpose"))])
    assert worst_moments(run, drawing, 0, 3) == []
    assert worst_moments(run, dataclasses.replace(drawing, instants=None), 0, 3) == []


@pytest.mark.parametrize("late", [0, 3])
def test_late_readings_are_counted(tmp_path, late):
    judged = [("a", Decision.LATE, Reason.TOO_LATE, None)] * late
    moment = moment_of(tmp_path, lambda s: judged + all_taken(s))
    assert any("late (too late)" in cause for cause in moment.causes) == bool(late)


def test_anchor_that_misled_most_is_named_by_its_readings_at_the_true_place(tmp_path):
    moment = moment_of(tmp_path, all_taken, off_m=lambda _, anchor: {"a": -0.3, "c": 3.0}.get(anchor, 0.0))
    std = np.hypot(np.hypot(0.15, 0.15), 0.05 * RANGE_M["c"])
    assert moment.causes == (f"believed c, 3.00 m farther than it was ({3.0 / std:.1f}σ)",)


def test_wrong_readings_that_were_refused_did_not_mislead_and_right_ones_were_refused_in_vain(tmp_path):
    def judge(second):
        return [("a", *TAKEN, 1.0), ("b", *TAKEN, 1.0), ("c", *GATED, 20.0)]

    moment = moment_of(tmp_path, judge, off_m=lambda _, anchor: 9.0 * (anchor == "c"))
    assert moment.causes == ("nothing unusual in the readings",)
    assert moment_of(tmp_path, judge).causes == ("did not believe c, though right",)


def test_growth_of_the_error_is_shared_out_among_scans_and_the_time_between_them(tmp_path):
    alone = moment_of(tmp_path, all_taken, odometry=lambda s: s != 30)
    assert alone.growth == Growth(1.0, 5.0, 0.0)
    silent = moment_of(tmp_path, lambda s: all_taken(s) if s < 30 else [])
    assert silent.growth == Growth(1.0, 0.0, 5.0)


def test_only_what_was_taken_counts_as_misleading(tmp_path):
    def judge(second):
        return [("a", *(GATED if second % 2 else TAKEN), 1.0), *all_taken(second)[1:]]

    moment = moment_of(tmp_path, judge, off_m=lambda s, anchor: 9.0 if anchor == "a" and s % 2 else 0.0)
    assert moment.causes == ("nothing unusual in the readings",)


def test_one_outlier_among_readings_that_are_right_is_named(tmp_path):
    moment = moment_of(tmp_path, all_taken, off_m=lambda s, anchor: 1.0 if anchor == "a" and s == 30 else 0.0)
    assert moment.causes == (
        f"believed one reading of a, 1.00 m farther than it was ({1.0 / np.hypot(0.15, 0.15):.1f}σ)",
    )


def test_kind_that_is_not_listened_to_misleads_nobody(tmp_path):
    ignored = Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED
    moment = moment_of(tmp_path, lambda s: [("a", *(TAKEN if s < 9 else ignored), 1.0)], off_m=lambda *_: 9.0)
    assert not any("believe" in cause for cause in moment.causes)


def test_run_without_odometry_is_distinguished_from_one_that_has_not_begun(tmp_path):
    assert moment_of(tmp_path, all_taken, odometry=lambda _: False).causes == ("no odometry in this run",)
    assert moment_of(tmp_path, all_taken, odometry=lambda s: s > 35).causes == ("no odometry yet",)
