"""Wheels of known scale and track are found again, within the intervals told; closed forms; poor input."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion import LogError, Pose
from fusion.odometry import Odometer
from fusion.robot import Robot
from fusion.values import nanoseconds
from logs.truth import TruthTrack
from sensors.calibration.arcs import WheelScales, arc_end
from sensors.calibration.odometry import calibrate_odometry, fit_scales, halves, score_held_out
from sensors.calibration.segments import SPIN, STRAIGHT, find_segments, read_segments
from sensors.calibration.umbmark import umbmark
from sensors.calibration.wheel_residuals import linear_trend, measured_segments
from sensors.calibration.wheels import wheels

TRACK = 0.3


def unequal(run, ratio):
    """The run as counted by wheels whose true rolls stand as ``ratio``, right over left, their mean kept."""
    left, right = 2.0 / (1.0 + ratio), 2.0 * ratio / (1.0 + ratio)
    told = tuple(
        dataclasses.replace(m, counts=(round(m.counts[0] / left), round(m.counts[1] / right)))
        if hasattr(m, "counts")
        else m
        for m in run.measurements
    )
    return dataclasses.replace(run, measurements=told)


def test_a_robot_without_noise_is_found_exactly(drive):
    run = drive(distance_scale_bias=0.04, track_scale_bias=0.1, slip_std=0.0, robot={"ticks_per_revolution": 20_000})
    found = calibrate_odometry([run])
    assert found.fit.scales.left == pytest.approx(1.0 / 1.04, rel=1e-4)
    assert found.fit.scales.right == pytest.approx(1.0 / 1.04, rel=1e-4)
    assert found.fit.scales.track_m == pytest.approx(1.1 * TRACK, rel=1e-3)
    assert {score.what: score.after < 0.1 * score.before for score in found.scores} == {
        "length of a piece": True,
        "turn of a piece": True,
    }


def test_intervals_hold_the_truth_as_often_as_they_say(drive):
    """Wheels 1 % unequal, 3 % wrong, a track 8 % wrong, slip and ticks: 95 % intervals of all three numbers."""
    held = []
    for seed in range(12):
        run = unequal(drive(seed, distance_scale_bias=0.03, track_scale_bias=0.08, slip_std=0.01), 1.01)
        numbers = calibrate_odometry([run]).numbers
        truth = {
            "left scale": 2.0 / 2.01 / 1.03,
            "right scale": 2.02 / 2.01 / 1.03,
            "right over left, E_d": 1.01,
            "effective track, m": 1.08 * TRACK,
        }
        held += [numbers[name].holds(value) for name, value in truth.items()]
    # Four standard deviations below 95 %, if the 48 were independent.
    assert np.mean(held) >= 0.82


@pytest.fixture(scope="module")
def calibrated(drive):
    """A drive and what is found from it."""
    run = drive(distance_scale_bias=0.03, track_scale_bias=0.08)
    return run, calibrate_odometry([run])


@settings(max_examples=5)
@given(turned=st.floats(-3.0, 3.0), moved=st.floats(-50.0, 50.0))
def test_turning_and_moving_the_floor_changes_nothing(calibrated, turned, moved):
    run, one = calibrated
    truth, (c, s) = run.truth, (math.cos(turned), math.sin(turned))
    other = TruthTrack(
        truth.time_ns, c * truth.x - s * truth.y + moved, s * truth.x + c * truth.y - moved, truth.heading + turned
    )
    two = calibrate_odometry([dataclasses.replace(run, truth=other)])
    assert two.fit.scales == pytest.approx(one.fit.scales, rel=1e-6)


def test_what_is_fitted_is_what_estimators_get(drive):
    """The same ticks through the host's own odometer, with the numbers in the world, end where the arcs do."""
    run = unequal(drive(distance_scale_bias=0.03, track_scale_bias=0.08), 1.02)
    scales = WheelScales(0.98, 1.01, 0.33)
    robot = scales.applied_to(run.world.robot)
    assert WheelScales.of(robot) == pytest.approx(scales)
    odometer, steps = Odometer(robot, run.measurements[0].time_ns), []
    for measurement in run.measurements:
        odometer.advance(measurement, lambda *step: steps.append(step))
    moved = [sum(distance_m for _, _, distance_m, _, _ in steps), sum(turn_rad for _, _, _, turn_rad, _ in steps)]
    told = wheels(run)
    end = arc_end(scales, np.diff(told.left), np.diff(told.right))
    ahead = 0.5 * (scales.left * told.left[-1] + scales.right * told.right[-1])
    assert moved == pytest.approx([ahead, end.heading], abs=1e-9)


def test_exact_arc_of_a_quarter_circle():
    """Left 0, right pi/2 with track 1: a quarter turn about the left wheel, half a metre to its right."""
    steps = np.full(7, math.pi / 2 / 7)
    end = arc_end(WheelScales(1.0, 1.0, 1.0), np.zeros(7), steps)
    assert end == pytest.approx(Pose(0.5, 0.5, math.pi / 2))


def square(sense, scales, nominal, side=4.0, steps=50):
    """End offset of a robot that believes it drives a square: true minus calculated, (1, 2)."""
    left, right = [], []
    for corner in range(4):
        left += [side / steps] * steps
        right += [side / steps] * steps
        if corner < 3:
            left += [-sense * math.pi / 4 * nominal / steps] * steps
            right += [sense * math.pi / 4 * nominal / steps] * steps
    ends = [arc_end(each, np.array(left), np.array(right)) for each in (scales, WheelScales(1.0, 1.0, nominal))]
    return np.array([[ends[0].x - ends[1].x, ends[0].y - ends[1].y]])


@pytest.mark.parametrize(("track", "ratio"), [(1.03, 1.0), (0.98, 1.0), (1.0, 1.001), (1.02, 1.001)])
def test_closed_form_of_umbmark_finds_small_errors(track, ratio):
    scales = WheelScales(2.0 / (1.0 + ratio), 2.0 * ratio / (1.0 + ratio), track * 0.5)
    found = umbmark(square(-1, scales, 0.5), square(1, scales, 0.5), 4.0, 0.5)
    assert found.track_ratio == pytest.approx(track, abs=0.003)
    assert found.diameter_ratio == pytest.approx(ratio, abs=0.0003)


def test_umbmark_of_a_perfect_robot_is_nothing():
    scales = WheelScales(1.0, 1.0, 0.5)
    found = umbmark(square(-1, scales, 0.5), square(1, scales, 0.5), 4.0, 0.5)
    assert (found.e_max_m, found.track_ratio, found.diameter_ratio) == pytest.approx((0.0, 1.0, 1.0))


def test_squares_are_found_and_judged_without_having_been_fitted(drive):
    run = drive(laps=2, distance_scale_bias=0.03, track_scale_bias=0.08)
    found = calibrate_odometry([run])
    assert found.squares == 4
    before, after = found.umbmark
    assert before.e_max_m > 0.5
    assert after.e_max_m < 0.2 * before.e_max_m


def test_the_papers_line_is_the_scale_of_the_straight_moves(drive):
    run = drive(distance_scale_bias=0.05)
    told = wheels(run)
    trend = linear_trend(measured_segments(find_segments(run, 0, told), [told], run.world.robot))
    assert trend.scale.holds(1.0 / 1.05)
    assert trend.offset_m.holds(0.0)


def test_piece_whose_heading_is_not_known_all_the_way_is_none_and_no_whole_turn_is_lost(drive):
    run = drive()
    turns = [each for each in find_segments(run, 0, wheels(run)) if abs(each.turn_rad) > 3.0]
    middle = (turns[0].from_ns + turns[0].until_ns) // 2
    for reach_s, kept in ((0.2, True), (1.0, False)):
        hidden = np.abs(run.truth.time_ns - middle) < nanoseconds(reach_s)
        heading = np.where(hidden, np.nan, run.truth.heading)
        partly = dataclasses.replace(run, truth=dataclasses.replace(run.truth, heading=heading))
        found = [each for each in find_segments(partly, 0, wheels(run)) if each.from_ns <= middle <= each.until_ns]
        assert [each.turn_rad == pytest.approx(turns[0].turn_rad, abs=1e-6) for each in found] == [True] * kept


def test_truth_without_headings_is_good_enough(drive):
    run = drive(laps=2, distance_scale_bias=0.03, track_scale_bias=0.08)
    blind = dataclasses.replace(run, truth=dataclasses.replace(run.truth, heading=np.full(len(run.truth), np.nan)))
    found = calibrate_odometry([blind])
    assert found.numbers["effective track, m"].holds(1.08 * TRACK)
    assert found.numbers["effective track, m"].reach < 0.02 * TRACK
    assert found.numbers["mean scale"].holds(1.0 / 1.03)


def test_segments_are_measured_by_hand_too(calibrated, tmp_path):
    """What the truth would say, typed into a file, gives the same calibration."""
    run, found = calibrated
    told, start = wheels(run), run.measurements[0].time_ns
    rows = ["from_s,until_s,distance_m,turn_rad"]
    for each in find_segments(run, 0, told):
        texts = ["" if math.isnan(value) else repr(value) for value in (each.distance_m, each.turn_rad)]
        rows.append(f"{(each.from_ns - start) / 1e9},{(each.until_ns - start) / 1e9},{','.join(texts)}")
    path = tmp_path / "tape.csv"
    path.write_text("\n".join(rows))
    assert {each.kind for each in read_segments(path, run, 0)} == {STRAIGHT, SPIN}
    blind = dataclasses.replace(run, truth=None)
    assert calibrate_odometry([blind], path).fit.scales == pytest.approx(found.fit.scales, rel=1e-6)


def test_nothing_is_scored_that_was_fitted(drive):
    """Each half is judged by the other: a half that is spoiled makes both scores bad."""
    run = drive(laps=2, slip_std=0.0)
    told = wheels(run)
    pieces = measured_segments(find_segments(run, 0, told), [told], run.world.robot)
    first = {id(each) for each in halves(pieces)[0]}
    spoiled = [
        each._replace(segment=each.segment._replace(distance_m=1.1 * each.segment.distance_m))
        if id(each) in first
        else each
        for each in pieces
    ]
    after = {score.what: score.after for score in score_held_out(spoiled, WheelScales(1.0, 1.0, TRACK), TRACK)}
    # Both halves miss the other by a tenth of some two metres; in-sample nothing would be left.
    assert after["length of a piece"] > 0.15


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"truth": None}, "holds no ground truth"),
        ({"measurements": ()}, "no wheel ticks and no odometry"),
    ],
)
def test_poor_runs_are_refused_with_the_remedy(drive, change, message):
    with pytest.raises(LogError, match=message):
        calibrate_odometry([dataclasses.replace(drive(), **change)])


def test_lines_alone_are_too_few():
    robot = Robot(drive="differential", track_width_m=TRACK)
    with pytest.raises(LogError, match=r"three straight lines and four spins"):
        fit_scales([], robot.track_width_m)
