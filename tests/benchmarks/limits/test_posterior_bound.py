"""The bound of a filter: published steady states, an independent recursion, and a filter that reaches it."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.limits.posterior_bound import eff_pcrlb, posterior_bound
from benchmarks.metrics.matching import match
from benchmarks.runner.estimator_run import run_estimator
from fusion import (
    Covariance,
    LogError,
    Odometry,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    Truth,
    WifiScan,
    World,
)
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.values import NANOSECONDS
from logs.run import Run
from logs.truth import TruthTrack, evaluation_instants

EXACT = {
    "distance_scale_std": 0.0,
    "turn_scale_std": 0.0,
    "turn_bias_std_rad_s": 0.0,
}
"""No error that stays for a whole run."""


def step_noise(noise, odometry):
    """Variances of one step forward, sideways and of the turn, as `OdometryNoise` has them."""
    path_m, turn_rad, duration_s = (
        abs(odometry.distance_m),
        abs(odometry.turn_rad),
        1e-9 * (odometry.time_ns - odometry.from_ns),
    )
    return (
        noise.distance_std_per_sqrt_m**2 * path_m + noise.distance_std_per_sqrt_s**2 * duration_s,
        noise.side_std_per_sqrt_m**2 * path_m,
        noise.turn_std_per_sqrt_rad**2 * turn_rad
        + noise.turn_std_per_sqrt_m**2 * path_m
        + noise.turn_std_per_sqrt_s**2 * duration_s,
    )


def a_run(world, measurements, truths, prior):
    return Run(Path("run.mcap"), "run", world, prior, {}, tuple(measurements), TruthTrack.from_truths(truths), (), {})


def parked(drift_m, count, *, first_std_m, std_db=4.0):
    """At the centre of a 10 m square of four anchors, one scan a second, ``drift_m`` a second on each axis."""
    places = ((0, 0), (10, 0), (10, 10), (0, 10))
    anchors = [{"id": f"ap{i}", "position_m": list(place)} for i, place in enumerate(places)]
    radio = {"path_loss_exponent": 3.0, "shadowing_std_db": std_db, "bias_std_db": 0.0}
    robot = {"drive": "none", "noise": {"drift_std_per_sqrt_s": drift_m, **EXACT}}
    world = World.from_table({"anchors": anchors, "radio": radio, "robot": robot})
    readings = tuple(RssiReading(anchor.id, -60.0) for anchor in world.anchors)
    scans = [WifiScan(k * NANOSECONDS, "wifi", k, readings) for k in range(1, count + 1)]
    truths = [Truth(k * NANOSECONDS, 5.0, 5.0, 0.0) for k in range(count + 1)]
    prior = Prior(0, Pose(5.0, 5.0, 0.0), Covariance.from_std(first_std_m, first_std_m, 0.1))
    return a_run(world, scans, truths, prior)


@pytest.mark.parametrize(("drift_m", "steady_m"), [(0.01, 0.174932), (0.05, 0.388621), (0.10, 0.545137)])
def test_parked_robot_settles_at_the_known_bound(drift_m, steady_m):
    found = posterior_bound(parked(drift_m, 1500, first_std_m=0.2))
    assert found.error_m[-1] == pytest.approx(steady_m, abs=5e-7)


def test_each_axis_follows_the_scalar_recursion():
    """J <- 1/(1/J + q) + 1/r with q = 0.01, r = 1, from J = 1: half of the squared bound is each axis' variance."""
    noise_db = math.sqrt(2.0) * 30.0 / (math.sqrt(50.0) * math.log(10.0))
    found = posterior_bound(parked(0.1, 200, first_std_m=1.0, std_db=noise_db)).error_m ** 2 / 2.0
    assert found[:3] == pytest.approx([1.0, 1.01 / 2.01, 0.338837538239], rel=1e-9)
    assert found[1] == pytest.approx(0.502487562189, rel=1e-11)
    assert found[-1] == pytest.approx(0.0951249219725, rel=1e-11)


def circle(**tables):
    """A known drive on a circle, truth with heading at the odometry's stamps."""
    drive = SyntheticRun(duration_s=12.0)
    table = json.loads(drive.world().table) | tables
    truths = [Truth(k * NANOSECONDS // 10, *drive.pose(k * NANOSECONDS // 10)) for k in range(121)]
    return a_run(World.from_table(table), drive.measurements(), truths, drive.prior())


def white(std_m=0.1):
    return {"std_m": std_m, "bias_std_m": 0.0, "scale_std": 0.0}


def test_agrees_with_the_information_recursion_written_out():
    """J <- (F J⁻¹ Fᵀ + G Q Gᵀ)⁻¹ + Σ Hᵀ R⁻¹ H, step by step; the truth is what odometry says, by the mid-point rule."""
    antenna = {"antenna_m": [0.3, 0.1, 0.5], "noise": EXACT}
    run = circle(ranging=white(0.2), radio={"bias_std_db": 0.0, "shadowing_std_db": 3.0}, robot=antenna)
    poses = {0: run.prior.pose}
    information = np.linalg.inv(np.array(run.prior.covariance.matrix))
    expected = {0: information}
    for measurement in run.measurements:
        if isinstance(measurement, Odometry):
            before, half, ahead = poses[measurement.from_ns], 0.5 * measurement.turn_rad, measurement.distance_m
            step = Pose(ahead * math.cos(half), ahead * math.sin(half), measurement.turn_rad)
            after = poses[measurement.time_ns] = before.compose(step)
            dx, dy = after.x - before.x, after.y - before.y
            c, s = math.cos(before.heading + half), math.sin(before.heading + half)
            forward = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
            spread = np.array([[c, -s, -0.5 * dy], [s, c, 0.5 * dx], [0.0, 0.0, 1.0]])
            noise = np.diag(step_noise(run.world.robot.noise, measurement))
            information = np.linalg.inv(forward @ np.linalg.inv(information) @ forward.T + spread @ noise @ spread.T)
        elif isinstance(measurement, Ranges | WifiScan):
            information = information + scan_information(run.world, measurement, poses[measurement.time_ns])
        expected[measurement.time_ns] = information
    truth = TruthTrack.from_truths([Truth(time_ns, *pose) for time_ns, pose in poses.items()])
    found = posterior_bound(dataclasses.replace(run, truth=truth))
    wanted = [math.sqrt(np.trace(np.linalg.inv(expected[t])[:2, :2])) for t in found.time_ns.tolist()]
    assert found.error_m == pytest.approx(wanted, rel=1e-7)
    assert found.error_m.min() < 0.7 * found.error_m.max()


def scan_information(world, scan, pose):
    """By finite differences of the expected readings."""

    def expected(x, y, heading):
        forward, left, up = world.robot.antenna_m
        px, py = Pose(x, y, heading).transform(forward, left)
        away = [math.dist((px, py, up), (a.x, a.y, a.z)) for a in world.anchors]
        models = [a.ranging if isinstance(scan, Ranges) else a.radio for a in world.anchors]
        return np.array([float(model.expected(d)) / model.std for model, d in zip(models, away, strict=True)])

    step = 1e-6
    rows = np.array(
        [(expected(*np.add(pose, step * e)) - expected(*np.subtract(pose, step * e))) / (2 * step) for e in np.eye(3)]
    )
    return rows @ rows.T


@pytest.mark.parametrize(
    "tables",
    [
        {"ranging": {"std_m": 0.1, "bias_std_m": 0.5, "scale_std": 0.0}},
        {"ranging": {"std_m": 0.1, "bias_std_m": 0.0, "scale_std": 0.2}},
        {"robot": {"noise": {**EXACT, "turn_bias_std_rad_s": 0.1}}},
        {"robot": {"noise": {**EXACT, "turn_scale_std": 0.3}}},
        {"robot": {"noise": {**EXACT, "distance_scale_std": 0.3}}},
    ],
)
def test_whatever_is_less_well_known_raises_the_bound(tables):
    known = {"ranging": white(), "radio": {"bias_std_db": 0.0}, "robot": {"noise": EXACT}}
    surer, less = posterior_bound(circle(**known)), posterior_bound(circle(**(known | tables)))
    assert (less.error_m >= surer.error_m * (1.0 - 1e-9)).all()
    assert less.error_m[-1] > 1.005 * surer.error_m[-1]


def test_readings_that_never_came_raise_the_bound():
    run = circle()
    silent = [m for m in run.measurements if not (isinstance(m, Ranges | WifiScan) and m.time_ns > 4 * NANOSECONDS)]
    whole, cut = posterior_bound(run), posterior_bound(dataclasses.replace(run, measurements=tuple(silent)))
    same = whole.time_ns <= 4 * NANOSECONDS
    assert cut.error_m[same] == pytest.approx(whole.error_m[same], rel=1e-12)
    assert cut.error_m[-1] > 2.0 * whole.error_m[-1]


def test_turned_world_has_the_same_bound():
    """The heading passes pi on the way, between two truths with a reading between them."""
    straight, turned = SyntheticRun(duration_s=6.0), SyntheticRun(duration_s=6.0, map_from_room=Pose(3.0, -2.0, 2.5))
    found = []
    for drive in (straight, turned):
        truths = [Truth(3 * k * NANOSECONDS // 10, *drive.pose(3 * k * NANOSECONDS // 10)) for k in range(21)]
        found.append(posterior_bound(a_run(drive.world(), drive.measurements(), truths, drive.prior())).error_m)
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_order_of_arrival_does_not_matter():
    run = circle()
    assert posterior_bound(dataclasses.replace(run, measurements=run.measurements[::-1])).error_m == pytest.approx(
        posterior_bound(run).error_m, rel=0, abs=0
    )


def test_truth_without_heading_leaves_the_bound_undefined_from_there_on():
    run = circle()
    heading = run.truth.heading.copy()
    heading[50:] = np.nan
    found = posterior_bound(dataclasses.replace(run, truth=dataclasses.replace(run.truth, heading=heading)))
    assert found.error_m[:50] == pytest.approx(posterior_bound(run).error_m[:50], rel=1e-12)
    assert np.isnan(found.error_m[55:]).all()


def test_run_without_truth_is_refused_with_the_remedy():
    run = circle()
    with pytest.raises(LogError, match="no ground truth"):
        posterior_bound(dataclasses.replace(run, truth=None))
    nowhere = dataclasses.replace(run.truth, x=np.full(len(run.truth), np.nan))
    with pytest.raises(LogError, match="no ground truth"):
        posterior_bound(dataclasses.replace(run, truth=nowhere))


def test_instants_are_those_of_the_scores_and_the_time_before_the_prior_is_undefined():
    run = circle()
    late = dataclasses.replace(run, prior=run.prior.__class__(NANOSECONDS, *_rest(SyntheticRun(), NANOSECONDS)))
    found = posterior_bound(late)
    assert found.time_ns.tolist() == evaluation_instants(run.truth).time_ns.tolist()
    assert np.isnan(found.error_m).tolist() == (found.time_ns < NANOSECONDS).tolist()


def _rest(drive, time_ns):
    return drive.pose(time_ns), drive.prior().covariance


def noisy(seed):
    """The circle with noise exactly as the world says: start, odometry, ranges four times a second."""
    drive, chance = SyntheticRun(duration_s=12.0, odometry_hz=4), np.random.default_rng(seed)
    tables = {"ranging": white(), "robot": {"noise": EXACT}}
    world = World.from_table(json.loads(drive.world().table) | tables)
    pose, covariance = drive.pose(0), Covariance.from_std(0.1, 0.1, 0.1)
    prior = Prior(0, Pose(*np.add(pose, chance.normal(0.0, 0.1, 3))), covariance)
    # What odometry says is drawn first, and the truth strays from it: the noise is on the motion.
    measurements, truths = [], [Truth(0, *pose)]
    for said in (m for m in drive.measurements() if isinstance(m, Odometry)):
        forward, side, turn = chance.normal(0.0, np.sqrt(step_noise(world.robot.noise, said)))
        turned = said.turn_rad + turn
        c, s = math.cos(0.5 * turned), math.sin(0.5 * turned)
        ahead = said.distance_m + forward
        pose = pose.compose(Pose(c * ahead - s * side, s * ahead + c * side, turned))
        measurements.append(said)
        truths.append(Truth(said.time_ns, *pose))
        away = [math.hypot(pose.x - a.x, pose.y - a.y) for a in world.anchors]
        ranges = [RangeReading(a.id, d + chance.normal(0.0, 0.1)) for a, d in zip(world.anchors, away, strict=True)]
        measurements.append(Ranges(said.time_ns, "uwb", said.seq, tuple(ranges)))
    return a_run(world, measurements, truths, prior)


def test_filter_that_models_everything_reaches_the_bound():
    """The EKF on runs whose noise is just what the world says, hardly nonlinear: over 1200 of them its mean square
    error was 0.993 +- 0.011 times the bound's; 40 tell that to some 5 %.
    """
    errors, bounds = [], []
    for seed in range(40):
        run = noisy(seed)
        instants, estimator_run = evaluation_instants(run.truth), run_estimator(run, "ekf", {"gate_probability": 1.0})
        answers = match(instants, estimator_run.track)
        errors.append(np.hypot(answers.x - instants.x, answers.y - instants.y)[1:])
        bounds.append(posterior_bound(run).error_m[1:])
    assert 0.94 < eff_pcrlb(np.array(errors), np.array(bounds)) < 1.06


def test_times_the_limit_is_the_mean_over_time_of_the_ratio_of_each_instant():
    errors = np.array([[1.0, 3.0, 2.0], [1.0, 4.0, 2.0]])
    bounds = np.array([[1.0, 1.0, np.nan], [1.0, 7.0, 1.0]])
    assert eff_pcrlb(errors, bounds) == pytest.approx((1.0 + math.sqrt(12.5 / 25.0)) / 2.0)


def test_times_the_limit_leaves_out_what_was_not_answered():
    errors = np.array([[2.0, np.inf], [np.inf, np.inf]])
    assert eff_pcrlb(errors, np.ones((2, 2))) == 2.0
    assert math.isnan(eff_pcrlb(errors[1:], np.ones((1, 2))))
    assert math.isnan(eff_pcrlb(np.ones((1, 2)), np.zeros((1, 2))))
