"""Readings from neighbouring places share the shadowing of the place, and must not count as independent."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.metrics.matching import match
from benchmarks.metrics.score import errors, metrics
from benchmarks.paper.variants import without_gyro
from benchmarks.runner.estimator_run import run_estimator
from fusion import (
    Covariance,
    Increment,
    Odometry,
    ParameterError,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    RssiReading,
    WifiScan,
    World,
    WorldError,
    build,
    radio_readings,
    track,
)
from fusion.correlated_error import repeated_variance, total_variance
from fusion.values import NANOSECONDS as SECOND
from logs.truth import evaluation_instants
from sensors.simulation.scenario import load_scenario
from sensors.simulation.simulate import simulated_run
from tests.worlds import PLAIN_NOISE, anchored_world

PLACES = {"a": (-20.0, 3.0), "b": (25.0, -15.0), "c": (3.0, 28.0)}
RADIO = {"shadowing_std_db": 2.0, "bias_std_db": 3.0, "path_loss_exponent": 2.5}
START = Prior(0, Pose(0.0, 0.0, 0.0), Covariance.from_std(3.0, 3.0, 0.01))
FILTERS = pytest.mark.parametrize("name", ["ekf", "filterpy_ekf", "filterpy_ukf", "particle", "bayes_grid"])


def world(**radio):
    return anchored_world(PLACES, radio={**RADIO, **radio}, robot={"noise": PLAIN_NOISE})


def scan(time_ns, seq):
    """The signal strengths that the world expects at the start."""
    model = world().anchors[0].radio
    readings = [RssiReading(name, float(model.expected(math.hypot(*place)))) for name, place in PLACES.items()]
    return WifiScan(time_ns, "wifi", seq, tuple(readings))


def spread(name, step_m, scans=40, radio=None, **options):
    """Trace of the position's covariance after ``scans``, the robot rocking to and fro by ``step_m`` in between."""
    measurements = []
    for k in range(1, scans + 1):
        measurements += [Odometry(k * SECOND, "w", k, (k - 1) * SECOND, step_m * (-1) ** k, 0.0), scan(k * SECOND, k)]
    place = world(**(radio or {}))
    covariance = list(track(build(name, place, options), place, measurements, START, seed=5))[-1].estimate.covariance
    return covariance.xx + covariance.yy


@pytest.mark.parametrize(("path_m", "times"), [(0.0, 3.0), (0.5, 3.0), (1.0, 2.0), (2.0, 1.0), (9.0, 1.0)])
def test_common_error_of_neighbouring_signal_strengths_counts_as_often_as_they_share_it(path_m, times):
    reading = radio_readings(world(), scan(0, 0))[0]
    assert repeated_variance(reading, path_m, 3.0) == pytest.approx(2.0**2 + times * 3.0**2)
    assert repeated_variance(reading, path_m, 1.0) == total_variance(reading)


def test_error_of_a_range_belongs_to_the_radio_and_is_not_counted_by_the_path():
    reading = radio_readings(world(), Ranges(0, "uwb", 0, (RangeReading("a", 20.0),)))[0]
    assert repeated_variance(reading, 0.0, 3.0) == total_variance(reading)


@FILTERS
def test_robot_at_rest_grows_less_certain_of_what_it_receives_again_and_again(name):
    """Three times the common error at most: the information is that of 2^2 + 3 * 3^2 dB^2 in place of 2^2 + 3^2."""
    assert spread(name, 0.0) > 1.5 * spread(name, 0.0, max_correlated=1.0)
    assert spread(name, 0.0, max_correlated=10.0) > 1.5 * spread(name, 0.0)


@FILTERS
def test_readings_further_apart_than_shadowing_reaches_count_in_full(name):
    assert spread(name, 2.5) == pytest.approx(spread(name, 2.5, max_correlated=1.0), rel=1e-12)


@pytest.mark.parametrize("name", ["ekf", "filterpy_ekf"])
def test_information_at_rest_is_that_of_the_inflated_noise(name):
    """The extended filters add H^T H / R a reading, to first order around the truth, where they stand."""
    place, scans = world(), 8
    slopes = [s.expect(0.0, 0.0, 0.0, place.robot.antenna_m) for s in radio_readings(place, scan(0, 0))]
    rows = np.array([(slope.by_x, slope.by_y) for slope in slopes])
    again = [scan(k * SECOND, k) for k in range(1, scans + 1)]
    start = Prior(0, START.pose, Covariance.from_std(1.0, 1.0, 1e-9))
    resting = [Odometry(k * SECOND, "w", k, (k - 1) * SECOND, 0.0, 0.0) for k in range(1, scans + 1)]
    both = [item for pair in zip(resting, again, strict=True) for item in pair]
    got = list(track(build(name, place), place, both, start))[-1].estimate.covariance
    information = np.eye(2) + scans * rows.T @ rows / (2.0**2 + 3.0 * 3.0**2)
    assert np.array(got.matrix)[:2, :2] == pytest.approx(np.linalg.inv(information), rel=1e-2)


@pytest.mark.parametrize("name", ["filterpy_ekf", "filterpy_ukf", "particle", "bayes_grid"])
def test_innovation_keeps_the_variance_of_one_reading(name):
    """What is repeated makes a reading worth less, not its innovation wider: the gate and NIS stay as they were."""
    place = world()
    fates = [
        next(iter(track(build(name, place, {"max_correlated": most}), place, [scan(SECOND, 1)], START))).fates
        for most in (1.0, 9.0)
    ]
    assert [fate.nis for fate in fates[0]] == [fate.nis for fate in fates[1]]


@FILTERS
@pytest.mark.parametrize("max_correlated", [0.99, math.nan, math.inf])
def test_impossible_sharing_is_refused(name, max_correlated):
    with pytest.raises(ParameterError, match="max_correlated is"):
        build(name, world(), {"max_correlated": max_correlated})


TOLD = {"shadowing_length_m": 5.0}


@pytest.mark.parametrize(
    ("path_m", "max_correlated", "times"), [(0.0, None, 20.0), (0.5, None, 10.0), (9.0, None, 1.0), (0.5, 4.0, 4.0)]
)
def test_common_error_counts_as_often_as_the_world_states_that_it_is_shared(path_m, max_correlated, times):
    reading = radio_readings(world(**TOLD), scan(0, 0))[0]
    assert repeated_variance(reading, path_m, max_correlated) == pytest.approx(2.0**2 + times * 3.0**2)


def test_common_error_counts_up_to_three_times_where_the_world_states_no_length():
    reading = radio_readings(world(), scan(0, 0))[0]
    assert repeated_variance(reading, 0.0, None) == repeated_variance(reading, 0.0, 3.0)


@FILTERS
def test_filter_that_knows_how_long_shadowing_lasts_is_not_made_sure_by_its_repetition(name):
    assert spread(name, 0.5, radio=TOLD) > 1.5 * spread(name, 0.5)


def test_error_of_an_anchor_is_a_state_where_the_world_states_its_length_or_a_parameter_asks():
    def states(place, **options):
        estimator = build("ekf", place, options)
        state = estimator.start(START, seed=0)
        scan = WifiScan(1, "wifi", 0, tuple(RssiReading(anchor.id, -50.0) for anchor in place.anchors))
        return len(estimator.step(state, Increment(), scan)[0].mean)

    assert states(world()) == states(world(**TOLD), estimate_rssi_bias=False) < states(world(**TOLD))
    assert states(world(), estimate_rssi_bias=True) == states(world(**TOLD))


@pytest.mark.parametrize("length_m", [0.0, -2.0])
def test_length_that_cannot_be_is_refused(length_m):
    with pytest.raises(WorldError, match=r"shadowing_length_m: .* must be greater than zero"):
        world(shadowing_length_m=length_m)


@pytest.fixture(scope="module")
def offices():
    """Two drives, without the gyro of the log, of which the office's world makes no use."""
    return [without_gyro(simulated_run(load_scenario("office"), seed)) for seed in (10, 11)]


@pytest.mark.parametrize("name", ["ekf", "particle"])
def test_filter_that_knows_the_length_is_more_honest_and_better_in_a_simulated_office(name, offices):
    """The simulated field is Gaussian with a squared-exponential correlation: alike, not equal, to what is assumed."""
    found = {}
    for stated in (True, False):
        scores = []
        for run in offices:
            table = json.loads(run.world.table)
            if not stated:
                del table["radio"]["shadowing_length_m"]
            lane = run_estimator(replace(run, world=World.from_table(table)), name, seed=0)
            instants = evaluation_instants(run.truth)
            scores.append(metrics(errors(instants, match(instants, lane.track))))
        found[stated] = [float(np.mean([score[key] for score in scores])) for key in ("pos_rmse", "anees")]
    assert found[True][0] < found[False][0]
    assert found[True][1] < 2.0
    assert found[False][1] > 3.0
