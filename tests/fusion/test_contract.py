"""The promises of the host and the shared mathematics that everything else leans on."""

import json
import math
import random
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fusion
from fusion import (
    Covariance,
    Decision,
    Gyro,
    Increment,
    MotorCommand,
    Odometry,
    OdometryNoise,
    ParameterError,
    PluginError,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    Reason,
    RssiReading,
    WheelTicks,
    WifiScan,
    World,
    WorldError,
    build,
    compose,
    digest,
    final,
    generator,
    radio_readings,
    track,
    wrap_angle,
)
from fusion.cli.main import main
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.odometry import Odometer, wheel_increment
from fusion.radio import PathLoss, Ranging, free_space_loss_db
from fusion.robot import Robot
from fusion.trilateration import closed_form, least_squares, trilaterate
from fusion.values import nanoseconds
from tests.fusion.streams import ANCHORS

SECOND = 1_000_000_000
NAMES = [name for name in fusion.names() if name != "nearest"]
reals = st.floats(-50.0, 50.0)
angles = st.floats(-3.0, 3.0)


def world(**extra):
    return World.from_table({"anchors": ANCHORS, **extra})


def prior(**known):
    return Prior(0, Pose(2.0, 1.0, 0.3), Covariance.from_std(0.1, 0.1, 0.1), **known)


def drive(seconds=20, seed=1):
    """A gentle curve with odometry at 10 Hz and a scan of all anchors at 2 Hz."""
    random_ = np.random.default_rng(seed)
    pose, measurements = Pose(2.0, 1.0, 0.3), []
    for k in range(1, seconds * 10 + 1):
        t = k * SECOND // 10
        pose = pose.compose(Pose(0.03, 0.0, 0.02))
        measurements.append(Odometry(t, "wheels", k, t - SECOND // 10, 0.03, 0.02))
        if k % 5 == 0:
            far = {a["id"]: math.dist((pose.x, pose.y, 0.0), a["position_m"]) for a in ANCHORS}
            readings = tuple(RangeReading(n, d + random_.normal(0, 0.1)) for n, d in far.items())
            measurements.append(Ranges(t, "uwb", k, readings))
    return measurements, pose


@given(angles, st.integers(-5, 5))
@settings(derandomize=True)
def test_wrapped_angle_is_the_same_angle(angle, turns):
    wrapped = wrap_angle(angle + turns * math.tau)
    assert -math.pi < wrapped <= math.pi
    assert math.isclose(math.remainder(wrapped - angle, math.tau), 0.0, abs_tol=1e-9)


@given(reals, reals, angles)
@settings(derandomize=True)
def test_pose_composed_with_its_inverse_is_the_origin(x, y, heading):
    pose = Pose(x, y, heading)
    assert pose.compose(pose.inverse()) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@given(st.floats(1.0, 500.0), st.floats(1.2, 5.0))
@settings(derandomize=True)
def test_path_loss_inverts(distance_m, exponent):
    model = PathLoss(path_loss_exponent=exponent)
    assert float(model.distance(model.expected(distance_m))) == pytest.approx(distance_m, rel=1e-12)


def test_path_loss_is_held_below_the_reference_distance():
    model = PathLoss()
    assert float(model.expected(0.2)) == float(model.expected(1.0))
    assert float(model.slope(0.2)) == 0.0
    assert float(model.distance(100.0)) == 1.0


def test_free_space_loss_at_a_metre_is_that_of_friis():
    """20 log10(4 pi / 0.125 m) at 2.4 GHz (wavelength 0.1249 m): 40.05 dB."""
    assert free_space_loss_db(1.0, 2.4e9) == pytest.approx(40.05, abs=0.01)


@given(st.floats(-20, 20), st.floats(-20, 20))
@settings(derandomize=True)
def test_trilateration_finds_the_place_from_exact_distances(x, y):
    anchors = np.array([[0.0, 0.0], [10.0, 1.0], [3.0, 8.0], [12.0, 9.0]])
    distances = np.hypot(*(anchors - (x, y)).T)
    assert closed_form(anchors[:3], distances[:3]) == pytest.approx((x, y), abs=1e-7)
    assert least_squares(anchors, distances, np.ones(4)) == pytest.approx((x, y), abs=1e-5)
    fix = trilaterate(anchors[:3], distances[:3], np.ones(3))
    assert (fix.x, fix.y) == closed_form(anchors[:3], distances[:3])


def test_collinear_anchors_are_refused_by_the_closed_form():
    with pytest.raises(WorldError, match="one line"):
        closed_form(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), np.ones(3))


@pytest.mark.parametrize("model", ["radio", "ranging"])
@given(x=reals, y=reals, heading=angles)
@settings(derandomize=True, max_examples=40)
def test_derivatives_of_a_sighting_are_those_of_finite_differences(model, x, y, heading):
    place = world(robot={"antenna_m": [0.3, -0.2, 0.5]})
    scan = (
        WifiScan(0, "w", 0, (RssiReading("a", -50.0),))
        if model == "radio"
        else Ranges(0, "r", 0, (RangeReading("a", 3.0),))
    )
    (reading,) = radio_readings(place, scan)
    antenna = place.robot.antenna_m
    here, step = reading.expect(x, y, heading, antenna), 1e-6
    if math.hypot(x, y) < 2.0:
        return
    for index, analytic in enumerate((here.by_x, here.by_y, here.by_heading)):
        moved = [x, y, heading]
        moved[index] += step
        ahead = reading.expect(*moved, antenna).value
        moved[index] -= 2 * step
        numeric = (ahead - reading.expect(*moved, antenna).value) / (2 * step)
        assert analytic == pytest.approx(numeric, abs=1e-5)


def steps(count=30):
    return [
        Odometry((k + 1) * 10**8, "w", k, k * 10**8, 0.05 + 0.01 * math.sin(k), 0.1 * math.cos(k)) for k in range(count)
    ]


def test_composing_an_increment_equals_stepping_through_it():
    noise, start = OdometryNoise(), (Pose(1.0, 2.0, 0.7), Covariance(0.1, 0.02, 0.01, 0.2, -0.01, 0.05))
    whole, stepped = Increment(), start
    for odometry in steps():
        whole = whole.extend(odometry, noise)
        stepped = compose(*stepped, Increment().extend(odometry, noise))
    at_once = compose(*start, whole)
    assert at_once[0] == pytest.approx(stepped[0], abs=1e-12)
    assert at_once[1] == pytest.approx(stepped[1], abs=1e-12)


def test_derivatives_of_an_increment_are_those_of_finite_differences():
    noise, small = OdometryNoise(), 1e-6

    def total(bias=0.0, scale=0.0):
        motion = Increment()
        for o in steps():
            motion = motion.extend(
                Odometry(o.time_ns, "w", o.seq, o.from_ns, o.distance_m, o.turn_rad * (1 + scale) + 0.1 * bias), noise
            )
        return motion

    plain = total()
    for by, moved in (
        (("x_by_bias", "y_by_bias"), (total(bias=small), total(bias=-small))),
        (("x_by_scale", "y_by_scale"), (total(scale=small), total(scale=-small))),
    ):
        for name, axis in zip(by, "xy", strict=True):
            numeric = (getattr(moved[0], axis) - getattr(moved[1], axis)) / (2 * small)
            assert getattr(plain, name) == pytest.approx(numeric, abs=1e-6)


@pytest.mark.parametrize("rate", [10, 50])
def test_covariance_of_a_motion_does_not_depend_on_the_message_rate(rate):
    """The same ten seconds in 100 or 500 messages: both must give the closed form for 3 m in 10 s."""
    noise, motion = (
        OdometryNoise(turn_std_per_sqrt_m=0.0, turn_std_per_sqrt_s=0.0, turn_std_per_sqrt_rad=0.0),
        Increment(),
    )
    for k in range(10 * rate):
        motion = motion.extend(Odometry((k + 1) * SECOND // rate, "w", k, k * SECOND // rate, 0.3 / rate, 0.0), noise)
    assert motion.covariance.xx == pytest.approx(
        noise.distance_std_per_sqrt_m**2 * 3.0 + noise.distance_std_per_sqrt_s**2 * 10.0
    )


@pytest.mark.parametrize("drive_", [("skid_steer", (3, 5, 3, 5)), ("differential", (3, 5))])
def test_wheel_ticks_become_distance_and_turn(drive_):
    """Left 3 and right 5 ticks of 1.02 cm at a track of 0.15 m: 4.08 cm forward, 2.04/15 rad to the left."""
    kind, counts = drive_
    odometer = Odometer(Robot(drive=kind))
    state, _ = odometer.advance(odometer.start(0), WheelTicks(SECOND, "e", 0, (0,) * len(counts)))
    _, (motion,) = odometer.advance(state, WheelTicks(2 * SECOND, "e", 1, counts))
    assert motion.distance_m == pytest.approx(0.0408)
    assert motion.turn_rad == pytest.approx(0.0204 / 0.15)


def test_single_channel_encoders_take_their_sign_from_the_command():
    odometer = Odometer(Robot(drive="differential", encoder="single_channel"))
    state, _ = odometer.advance(odometer.start(0), WheelTicks(1, "e", 0, (0, 0)))
    state, _ = odometer.advance(state, MotorCommand(2, "m", 0, (-0.1, 0.1)))
    _, (motion,) = odometer.advance(state, WheelTicks(SECOND, "e", 1, (2, 2)))
    assert motion.distance_m == pytest.approx(0.0)
    assert motion.turn_rad == pytest.approx(2 * 2 * 0.0102 / 0.15)


def test_a_wheel_that_rolls_out_after_a_command_to_stand_goes_on_in_its_direction():
    """Left backwards, right forwards; then both are to stand, and each still gives two ticks."""
    odometer = Odometer(Robot(drive="differential", encoder="single_channel"))
    state, _ = odometer.advance(odometer.start(0), MotorCommand(1, "m", 0, (-0.1, 0.1)))
    state, _ = odometer.advance(state, WheelTicks(2, "e", 0, (9, 9)))
    state, _ = odometer.advance(state, MotorCommand(3, "m", 1, (0.0, -0.0)))
    _, (motion,) = odometer.advance(state, WheelTicks(SECOND, "e", 1, (11, 11)))
    assert motion.distance_m == pytest.approx(0.0)
    assert motion.turn_rad == pytest.approx(2 * 2 * 0.0102 / 0.15)


def test_wheels_of_two_sizes_are_distinguished_and_their_mean_is_kept():
    """Borenstein & Feng: with the right wheel 2 % larger, equal counts are a left turn over the same distance."""
    distance, turn = wheel_increment(Robot(drive="differential", track_width_m=0.5, diameter_ratio=1.02), (1.0, 1.0))
    assert distance == pytest.approx(1.0)
    assert turn == pytest.approx(2.0 * 0.02 / 2.02 / 0.5)


def test_gyro_scale_stretches_what_is_left_without_the_bias():
    odometer = Odometer(Robot(drive="differential", turn_source="gyro", gyro_bias_rad_s=0.1, gyro_scale=1.2))
    state = odometer.start(0)
    for k in range(11):
        state, _ = odometer.advance(state, Gyro(k * SECOND // 10, "g", k, 0.6))
    _, (motion,) = odometer.advance(state, Odometry(SECOND, "w", 0, 0, 0.2, 9.9))
    assert motion.turn_rad == pytest.approx(0.6)


def test_gyro_gives_the_turn_where_the_world_makes_it_the_source():
    odometer = Odometer(Robot(drive="differential", turn_source="gyro", gyro_bias_rad_s=0.1))
    state = odometer.start(0)
    for k in range(11):
        state, _ = odometer.advance(state, Gyro(k * SECOND // 10, "g", k, 0.6))
    _, (motion,) = odometer.advance(state, Odometry(SECOND, "w", 0, 0, 0.2, 9.9))
    assert motion.turn_rad == pytest.approx(0.5)


def test_motion_held_up_to_a_radio_reading_is_counted_once():
    odometer = Odometer(Robot())
    state, first = odometer.advance(odometer.start(0), Odometry(SECOND, "w", 0, 0, 1.0, 0.2))
    state, held = odometer.hold(state, SECOND + SECOND // 4)
    _, rest = odometer.advance(state, Odometry(2 * SECOND, "w", 1, SECOND, 0.8, -0.1))
    seen = (*first, *held, *rest)
    assert [m.time_ns for m in seen] == [SECOND, SECOND + SECOND // 4, 2 * SECOND]
    assert sum(m.distance_m for m in seen) == pytest.approx(1.8)
    assert sum(m.turn_rad for m in seen) == pytest.approx(0.1)


@settings(derandomize=True, max_examples=40)
@given(st.integers(0, nanoseconds(0.004)), st.integers(1, 99), st.floats(0.1, 1.5))
def test_message_stamped_right_behind_the_one_before_makes_no_leap(behind_ns, held_ms, speed_m_s):
    """Steady motion at 10 Hz; a reception held up stamps two messages almost alike, then comes a radio reading."""
    odometer, tenth, step_m = Odometer(Robot()), SECOND // 10, 0.1 * speed_m_s
    state, stamps = odometer.start(0), [0, tenth, 3 * tenth, 3 * tenth + behind_ns]
    for k, (from_ns, until_ns) in enumerate(pairwise(stamps)):
        state, _ = odometer.advance(state, Odometry(until_ns, "w", k, from_ns, step_m, 0.2))
    _, (held,) = odometer.hold(state, stamps[-1] + held_ms * SECOND // 1000)
    assert 0.0 < held.distance_m < 3.0 * step_m
    assert 0.0 < held.turn_rad < 3.0 * 0.2


DRIVE = SyntheticRun(noisy=True, duration_s=8.0)


def cut(measurements, at_ns):
    """The measurements of the time after ``at_ns``: the increment across it in two, the first of them left out."""
    for m in measurements:
        if m.time_ns < at_ns or (isinstance(m, Odometry) and m.time_ns == at_ns):
            continue
        if isinstance(m, Odometry) and m.from_ns < at_ns:
            share = (m.time_ns - at_ns) / (m.time_ns - m.from_ns)
            m = replace(m, from_ns=at_ns, distance_m=share * m.distance_m, turn_rad=share * m.turn_rad)  # noqa: PLW2901
        yield m


def started_at(time_ns):
    return replace(DRIVE.prior(), time_ns=time_ns, pose=DRIVE.pose(time_ns))


@pytest.mark.parametrize("name", ["dead_reckoning", "ekf", "particle"])
@given(st.integers(0, nanoseconds(6.0)) | st.integers(0, 60).map(lambda k: k * SECOND // 10))
@settings(derandomize=True, max_examples=15)
def test_run_started_anywhere_counts_no_motion_before_its_start(name, at_ns):
    """Cut between two increments or inside one: as if the odometry before had never been, in pose and noise."""
    measurements, place, start = DRIVE.measurements(), DRIVE.world(), started_at(at_ns)
    whole, later = (
        final(track(build(name, place), place, stream, start, seed=3))
        for stream in (measurements, cut(measurements, at_ns))
    )
    whole = [update for update in whole if not (update.fates and update.fates[0].reason is Reason.TOO_LATE)]
    assert len(whole) == len(later)
    for one, other in zip(whole, later, strict=True):
        assert one.estimate.pose == pytest.approx(other.estimate.pose, abs=1e-9)
        assert one.estimate.covariance == pytest.approx(other.estimate.covariance, abs=1e-9)


@given(st.integers(0, nanoseconds(6.0)) | st.integers(0, 60).map(lambda k: k * SECOND // 10))
@settings(derandomize=True, max_examples=25)
def test_run_started_anywhere_from_the_truth_ends_at_the_truth(at_ns):
    """The odometry is exact but for the arc taken as a chord, so where the cut lies must not show."""
    place = DRIVE.world()
    last = final(track(build("dead_reckoning", place), place, DRIVE.measurements(), started_at(at_ns)))[-1].estimate
    assert math.dist(last.pose[:2], DRIVE.pose(last.time_ns)[:2]) < 1e-3
    assert abs(wrap_angle(last.pose.heading - DRIVE.pose(last.time_ns).heading)) < 1e-9


def test_twist_of_an_increment_across_the_start_is_that_of_all_of_it():
    odometer, half = Odometer(Robot()), SECOND // 2
    state, (motion,) = odometer.advance(odometer.start(half), Odometry(SECOND, "w", 0, 0, 1.0, 0.2))
    assert (motion.from_ns, motion.distance_m, motion.turn_rad) == (half, 0.5, 0.1)
    _, (held,) = odometer.hold(state, SECOND + half)
    assert (held.distance_m, held.turn_rad) == pytest.approx((0.5, 0.1))


@pytest.mark.parametrize("from_ns", [0, SECOND // 2, SECOND])
def test_increment_over_by_the_start_is_late_and_moves_nothing(from_ns):
    place, start = world(), replace(prior(), time_ns=SECOND)
    (update,) = track(build("dead_reckoning", place), place, [Odometry(SECOND, "w", 0, from_ns, 1.0, 0.2)], start)
    assert [(f.decision, f.reason, f.weight) for f in update.fates] == [(Decision.LATE, Reason.TOO_LATE, 0.0)]
    assert update.estimate.pose == start.pose
    assert update.estimate.covariance == pytest.approx(start.covariance)


@pytest.mark.parametrize("name", NAMES)
def test_shuffled_inside_the_horizon_gives_the_same_bytes(name):
    measurements, _ = drive(seconds=6)
    chance = random.Random(7)
    shuffled = sorted(measurements, key=lambda m: m.time_ns + chance.uniform(0, 1.5e9))
    place = world()
    in_order, late = (
        digest(final(track(build(name, place), place, ms, prior(), seed=3))) for ms in (measurements, shuffled)
    )
    assert in_order == late


@pytest.mark.parametrize("name", NAMES)
def test_drive_with_exact_odometry_ends_near_the_truth(name):
    """Fixes keep their noise, and the paper's percentage rule may refuse good ones: all end within half a metre."""
    measurements, pose = drive()
    place = world()
    last = list(track(build(name, place), place, measurements, prior()))[-1].estimate
    assert math.dist(last.pose[:2], pose[:2]) < 0.5


@pytest.mark.parametrize("name", NAMES)
def test_every_estimator_keeps_the_promises_of_a_fate_and_an_estimate(name):
    measurements, _ = drive(seconds=5)
    place = world()
    for update in track(build(name, place), place, measurements, prior()):
        estimate = update.estimate
        assert -math.pi <= estimate.pose.heading <= math.pi
        assert all(map(math.isfinite, estimate.pose))
        if estimate.covariance is not None:
            assert np.linalg.eigvalsh(np.array(estimate.covariance.matrix)).min() > -1e-9
        if isinstance(update.measurement, Ranges):
            assert sorted(f.anchor for f in update.fates) == ["a", "b", "c"]
        assert all(0.0 <= f.weight <= 1.0 for f in update.fates)


@pytest.mark.parametrize("name", NAMES)
def test_no_radio_for_minutes_neither_fails_nor_grows_certain(name):
    place = world()
    motion = [Odometry(k * SECOND, "w", k, (k - 1) * SECOND, 0.1, 0.05) for k in range(1, 301)]
    updates = list(track(build(name, place), place, motion, prior()))
    first, last = updates[0].estimate, updates[-1].estimate
    if first.covariance is not None and last.covariance is not None and first.valid:
        assert last.covariance.xx + last.covariance.yy > first.covariance.xx + first.covariance.yy


@pytest.mark.parametrize("name", ["bayes_weight", "dead_reckoning", "ekf", "filterpy_ekf"])
def test_turning_and_shifting_the_world_turns_and_shifts_the_answer(name):
    turned = Pose(3.0, -2.0, 2.0)
    measurements, _ = drive()
    bounds = {"x_min": -30.0, "x_max": 30.0, "y_min": -30.0, "y_max": 30.0}
    moved = [{"id": a["id"], "position_m": [*turned.transform(*a["position_m"][:2]), 2]} for a in ANCHORS]
    plain, other = world(bounds=bounds), World.from_table({"anchors": moved, "bounds": bounds})
    start = prior()
    there = Prior(0, turned.compose(start.pose), start.covariance)
    a = list(track(build(name, plain), plain, measurements, start))[-1].estimate.pose
    b = list(track(build(name, other), other, measurements, there))[-1].estimate.pose
    assert turned.compose(a) == pytest.approx(b, abs=1e-7)


def fates_of(measurement, name="dead_reckoning"):
    place = world()
    start = [Odometry(k * SECOND, "w", k, (k - 1) * SECOND, 0.1, 0.0) for k in range(1, 11)]
    *_, update = track(build(name, place), place, [*start, measurement], prior())
    return [(f.anchor, f.decision, f.reason) for f in update.fates]


def test_old_measurement_gets_the_fate_late():
    assert fates_of(Ranges(SECOND, "r", 0, (RangeReading("a", 1.0),))) == [("a", Decision.LATE, Reason.TOO_LATE)]


def test_same_measurement_twice_counts_once():
    again = Odometry(10 * SECOND, "w", 10, 9 * SECOND, 0.1, 0.0)
    assert fates_of(again) == [("", Decision.UNUSABLE, Reason.DUPLICATE)]


def test_stamp_hours_ahead_is_not_believed_at_once():
    assert fates_of(Gyro(10**5 * SECOND, "g", 0, 0.0)) == [("", Decision.UNUSABLE, Reason.BAD_CLOCK)]


@pytest.mark.parametrize("name", NAMES)
def test_gyro_that_is_not_the_source_of_turns_is_unusable_to_every_estimator_alike(name):
    measurements, _ = drive(seconds=3)
    gyro = [Gyro(k * SECOND // 4 + 1, "gyro", k, 0.2) for k in range(1, 12)]
    place = world()
    without, with_gyro = (
        list(track(build(name, place), place, stream, prior(), seed=3))
        for stream in (measurements, sorted([*measurements, *gyro], key=lambda m: m.time_ns))
    )
    ignored = [update for update in with_gyro if isinstance(update.measurement, Gyro)]
    verdicts = {(f.anchor, f.decision, f.reason, f.weight) for update in ignored for f in update.fates}
    assert [len(update.fates) for update in ignored] == [1] * len(gyro)
    assert verdicts == {("", Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED, 0.0)}
    assert digest(without) == digest(update for update in with_gyro if update not in ignored)


NAMED = {"seed": 1, "time_ns": 5 * SECOND, "sensor": "uwb", "seq": 7, "purpose": 0}


@pytest.mark.parametrize(
    "other", [{}, {"seed": 2}, {"time_ns": 6 * SECOND}, {"sensor": "wifi"}, {"seq": 8}, {"purpose": 1}], ids=str
)
def test_random_numbers_of_an_epoch_are_named_by_it_and_the_seed_alone(other):
    one, again = generator(**NAMED), generator(**NAMED | other)
    assert (one.random(8).tolist() == again.random(8).tolist()) is (not other)


def test_unusable_readings_are_named_one_by_one():
    bad = (
        RssiReading("a", math.nan),
        RssiReading("zz", -50.0),
        RssiReading("b", 127.0),
        RssiReading("c", -60.0, 10 * SECOND),
    )
    reasons = [reason for _, _, reason in fates_of(WifiScan(11 * SECOND, "wifi", 0, bad), "ekf")]
    assert reasons == [Reason.NOT_FINITE, Reason.UNKNOWN_ANCHOR, Reason.OUT_OF_RANGE, Reason.STALE]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"anchor": []}, "did you mean 'anchors'"),
        ({"anchors": [*ANCHORS, ANCHORS[0]]}, "stands twice"),
        ({"anchors": [*ANCHORS, {"id": "d", "position_m": [0, 0, 2]}]}, "remove one"),
        ({"anchors": [{"id": i, "position_m": [k, k]} for k, i in enumerate("abc")]}, "one line"),
        ({"anchors": [{"id": "a", "position_m": [0, math.nan]}]}, "not a finite number"),
        ({"radio": {"path_los_exponent": 2.0}}, "did you mean 'path_loss_exponent'"),
        ({"robot": {"drive": "hover"}}, "none of"),
        ({"robot": {"track_width_m": 0.0}}, "greater than zero"),
        ({"robot": {"diameter_ratio": -1.0}}, "greater than zero"),
        ({"calibration": {"radio": {"metod": "by eye"}}}, "did you mean 'method'"),
        ({"anchors": []}, "add"),
    ],
)
def test_world_that_cannot_be_is_refused_with_the_remedy(change, message):
    with pytest.raises(WorldError, match=message):
        World.from_table({"anchors": ANCHORS, **change})


def test_hash_of_a_world_does_not_depend_on_the_order_of_its_keys():
    table = {"name": "x", "anchors": ANCHORS}
    assert World.from_table(table).hash == World.from_table(dict(reversed(table.items()))).hash
    assert json.loads(World.from_table(table).table) == table


def test_unknown_estimator_and_parameter_are_answered_with_the_nearest():
    with pytest.raises(PluginError, match="did you mean 'ekf'"):
        build("efk", world())
    with pytest.raises(ParameterError, match="did you mean 'gate_probability'"):
        build("ekf", world(), {"gate_probabilty": 0.9})
    with pytest.raises(ParameterError, match="takes a float"):
        build("ekf", world(), {"gate_probability": "high"})


def test_ranging_inverts():
    model = Ranging(scale=1.07, offset_m=0.3)
    assert float(model.distance(model.expected(4.2))) == pytest.approx(4.2, rel=1e-12)


@pytest.mark.parametrize("code", ["import fusion", "import fusion.cli.main; fusion.cli.main.main(['--help'])"])
def test_start_up_imports_nothing_heavy(code):
    heavy = {"rerun", "scipy", "filterpy", "matplotlib", "mcap", "rich"}
    ask = f"{code}\nimport sys; print(); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", ask], check=True, capture_output=True, text=True).stdout
    assert not heavy & set(loaded.splitlines()[-1].split())


def test_command_line_answers_wrong_words(capsys):
    assert main(["bnch"]) == 2
    assert "did you mean 'bench'" in capsys.readouterr().err
    assert main(["info", "no-such-file.mcap"]) == 1
    assert "no-such-file.mcap" in capsys.readouterr().err


def test_public_names_exist():
    assert all(hasattr(fusion, name) for name in fusion.__all__)


@pytest.mark.parametrize("count", [3, 4])
def test_covariance_of_a_fix_is_that_of_its_scatter(count):
    """Outside the triangle the closed form errs more than least squares would; 4000 draws show it."""
    anchors = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0], [5.0, 6.0]])[:count]
    place, stds = np.array([6.0, 5.0]), np.full(count, 0.02)
    exact = np.hypot(*(anchors - place).T)
    chance = np.random.default_rng(5)
    fixes = np.array([trilaterate(anchors, exact + chance.normal(0, 0.02, count), stds)[:2] for _ in range(4000)])
    claimed = trilaterate(anchors, exact, stds)
    assert np.cov(fixes.T) == pytest.approx(np.array([[claimed.xx, claimed.xy], [claimed.xy, claimed.yy]]), rel=0.1)
