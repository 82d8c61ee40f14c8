"""The paper's weights behind a gate from covariances: numbers worked out by hand, both of the paper's weaknesses."""

import math

import numpy as np
import pytest

from estimators.dynamic_weight import DynamicWeight
from estimators.dynamic_weight_repaired import DynamicWeightRepaired, State, average
from fusion import Covariance, Decision, Increment, Odometry, ParameterError, Pose, Prior, Reason
from fusion.trilateration import Fix
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import Stepped
from tests.worlds import PLACES, exact_ranges, ranged_world

START = Pose(4.0, 3.0, 0.0)


def world(arm=(0.0, 0.0, 0.0), std_m=0.1):
    places = {name: PLACES[name] for name in "abc"}
    return ranged_world(places, ranging={"std_m": std_m}, robot={"antenna_m": list(arm)})


def scan(k, x, y, names="abc"):
    return exact_ranges(k * SECOND, k, (x, y), names)


def believing(counter=0, std=0.3, known=True):
    """At the origin, standing still, with 0.3 m per axis."""
    return State(Pose(0.0, 0.0, 0.0), Covariance.from_std(std, std, 0.1), counter, (), known)


def weigh(away, counter=0, known=True, **options):
    """A fix so far along x, 0.4 m per axis: S = 0.09 + 0.16 = 0.25, NIS = away^2 / 0.25."""
    state, fix = believing(counter, known=known), Fix(away, 0.0, 0.16, 0.0, 0.16)
    return DynamicWeightRepaired(world(), **options).weigh(state, state.pose, state.covariance, fix)


def fed(estimator, measurements, start=START, std=0.1, **known):
    """The estimator after all measurements, and the Fates of each."""
    robot = Stepped(estimator, Prior(0, start, Covariance.from_std(std, std, 0.1), **known))
    return robot, [robot.feed(measurement) for measurement in measurements]


@pytest.mark.parametrize(
    ("away", "counter", "expected"),
    [
        # The gate is -2 ln(1 - 0.99) = 9.21034: sqrt(9.21034 * 0.25) = 1.51743 m.
        pytest.param(1.517, 0, (0.5, 0), id="inside the gate: one half each, counter 0"),
        pytest.param(1.518, 0, (0.0, 1), id="outside: an outlier, counter 1"),
        pytest.param(1.517, 2, (0.5, 0), id="counter below epsilon"),
        # A counter of 2 trebles the half-width: 4.55229 m.
        pytest.param(4.552, 2, (0.5, 0), id="inside the gate widened by two outliers"),
        pytest.param(4.553, 2, (0.0, 3), id="outside it still"),
        # A counter of 3 is epsilon, and makes it 6.06972 m.
        pytest.param(6.069, 3, (0.75, 0), id="counter at epsilon: raised weight"),
    ],
)
def test_gate_and_weights_worked_out_by_hand(away, counter, expected):
    assert weigh(away, counter) == expected


def test_gate_passes_its_share_of_good_fixes():
    """4000 fixes drawn as the covariances claim, gate at 90 %: 0.9 within four standard deviations of a binomial."""
    random = np.random.default_rng(5)
    estimator, state = DynamicWeightRepaired(world(), gate_probability=0.9), believing()
    draws = random.normal(0.0, math.sqrt(0.25), (4000, 2))
    passed = [estimator.weigh(state, state.pose, state.covariance, Fix(x, y, 0.16, 0.0, 0.16))[0] > 0 for x, y in draws]
    assert np.mean(passed) == pytest.approx(0.9, abs=4.0 * math.sqrt(0.9 * 0.1 / 4000))


def test_average_is_equation_5_with_the_covariance_of_its_gain():
    """Weight 0.25, P = 0.09, R = 0.16 per axis: x = 0.25 * 2 = 0.5; xx = 0.75^2 * 0.09 + 0.25^2 * 0.16 = 0.060625."""
    state = believing()
    pose, spread = average(state.pose, state.covariance, Fix(2.0, -1.0, 0.16, 0.0, 0.16), 0.25, world())
    assert pose == pytest.approx((0.5, -0.25, 0.0))
    assert (spread.xx, spread.xy, spread.yy, spread.hh) == pytest.approx((0.060625, 0.0, 0.060625, 0.01))


def test_average_covers_its_errors_wherever_the_antenna_sits():
    """5000 draws of belief and fix: the covariance claimed is that of the errors, heading and arm in it."""
    random, place = np.random.default_rng(2), world(arm=(0.4, -0.2, 0.0))
    spread = Covariance(0.0009, 0.0002, -0.0001, 0.0016, 0.0003, 0.0004)
    truth, noise = Pose(1.0, 2.0, 0.7), np.array([[0.0005, 0.0001], [0.0001, 0.0003]])
    beliefs = random.multivariate_normal(truth, spread.matrix, 5000)
    antenna = truth.transform(0.4, -0.2)
    fixes = random.multivariate_normal(antenna, noise, 5000)
    errors = []
    for belief, (x, y) in zip(beliefs, fixes, strict=True):
        pose, claimed = average(Pose(*belief), spread, Fix(x, y, noise[0, 0], noise[0, 1], noise[1, 1]), 0.6, place)
        errors.append(np.subtract(pose, truth))
    assert np.cov(np.array(errors).T) == pytest.approx(np.array(claimed.matrix), abs=4e-5)


def test_outliers_are_refused_and_leave_position_and_covariance_to_odometry():
    robot, (fates,) = fed(DynamicWeightRepaired(world()), [scan(1, 7.0, 3.0)])
    state = robot.state
    assert {(f.decision, f.reason, f.weight) for f in fates} == {(Decision.REJECTED, Reason.OUTLIER, 0.0)}
    assert (state.pose, state.odo_counter) == (START, 1)
    assert (state.covariance.xx, state.covariance.yy) == pytest.approx((0.01, 0.01))
    assert all(f.nis == pytest.approx(f.innovation**2 / f.innovation_variance) for f in fates)


@pytest.mark.parametrize("away", [2.0, 4.0])
def test_lock_out_is_cured_by_the_widening_gate_and_by_nothing_else(away):
    """Told to be ``away`` metres from where it stands, sure to 10 cm; every fix is exact."""
    start, fixes = Pose(4.0 + away, 3.0, 0.0), [scan(k, 4.0, 3.0) for k in range(1, 41)]
    robot, fates = fed(DynamicWeightRepaired(world()), fixes, start)
    assert fates[0][0].decision is Decision.REJECTED
    assert math.dist(robot.state.pose[:2], (4.0, 3.0)) < 0.01
    for stubborn in (DynamicWeightRepaired(world(), widening=0.0), DynamicWeight(world())):
        stuck, fates = fed(stubborn, fixes, start)
        assert {f.decision for each in fates for f in each} == {Decision.REJECTED}
        assert math.dist(stuck.estimate(40 * SECOND).pose[:2], (4.0, 3.0)) == pytest.approx(away)


def test_unknown_position_believes_the_first_fix_whole():
    nowhere = Pose(math.nan, math.nan, 0.0)
    robot, (fates,) = fed(DynamicWeightRepaired(world()), [scan(1, 6.0, 2.0)], nowhere, position_known=False)
    assert robot.state.pose[:2] == pytest.approx((6.0, 2.0))
    assert [f.innovation for f in fates] == [None] * 3
    assert not DynamicWeightRepaired(world()).estimate(believing(known=False), Increment(), 0).valid


def test_two_anchors_give_no_fix_and_motion_goes_on():
    step = Odometry(SECOND, "wheels", 1, 0, 0.5, 0.0)
    robot, (_, fates) = fed(DynamicWeightRepaired(world()), [step, scan(2, 4.5, 3.0, names="ab")])
    assert {f.reason for f in fates} == {Reason.TOO_FEW_ANCHORS}
    assert robot.estimate(2 * SECOND).pose[:2] == pytest.approx((4.5, 3.0))


def test_stretch_without_radio_is_motion_alone():
    step = Odometry(SECOND, "wheels", 1, 0, 0.5, 0.2)
    robot, _ = fed(DynamicWeightRepaired(world()), [scan(0, 7.0, 3.0), step])
    before = robot.estimate(SECOND)
    assert robot.close() == ()
    assert robot.state.odo_counter == 1
    assert robot.estimate(SECOND) == before


@pytest.mark.parametrize(
    "options",
    [
        {"gate_probability": 1.0},
        {"gate_probability": 0.0},
        {"widening": -1.0},
        {"epsilon": -1},
        {"raised_weight": 0.4},
        {"window_s": -1.0},
    ],
)
def test_impossible_options_are_refused(options):
    with pytest.raises(ParameterError, match=f"dynamic_weight_repaired: .*{next(iter(options))}"):
        DynamicWeightRepaired(world(), **options)
