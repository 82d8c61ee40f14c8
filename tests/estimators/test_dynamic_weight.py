"""Algorithms 1 and 2 of Moro & Mehrpouyan 2019, line by line with hand-made numbers, and every open reading."""

import math

import numpy as np
import pytest

from estimators.dynamic_weight import DynamicWeight, allocate, weighted_average
from fusion import Covariance, Decision, Odometry, ParameterError, Pose, Prior, Reason, RssiReading, WifiScan, World
from fusion.values import NANOSECONDS as SECOND
from tests.estimators.stepping import Stepped
from tests.worlds import anchored_world, exact_ranges

PLACES = {"a": (0.0, 0.0), "b": (8.0, 0.0), "c": (1.0, 6.0)}
START = Pose(4.0, 3.0, 0.0)
GOOD = (4.2, 2.8)
"""Differs from (4, 3) by (0.2, 0.2), less than 10 % of either coordinate: (0.4, 0.3)."""
BAD = (6.0, 3.0)


def world(places=PLACES, robot=None, corner=(0.0, 0.0)):
    """A floor of 30 m by 40 m: its diagonal is 50 m."""
    x, y = corner
    bounds = {"x_min": x, "x_max": x + 30.0, "y_min": y, "y_max": y + 40.0}
    return anchored_world(places, bounds=bounds, robot=robot or {})


class Robot:
    """Feeds one estimator, one measurement a second."""

    def __init__(self, place=None, start=START, known=None, places=PLACES, **options):
        prior = Prior(0, start, Covariance.from_std(0.1, 0.1, 0.1), **(known or {}))
        self.stepped = Stepped(DynamicWeight(place or world(places), **options), prior)
        self.places, self.k = places, 0

    def scan(self, x, y, names="abc"):
        """Exact ranges from (x, y); answers the Fates."""
        self.k += 1
        return self.stepped.feed(exact_ranges(self.k * SECOND, self.k, (x, y), names, self.places))

    def drive(self, distance, turn=0.0):
        self.k += 1
        self.stepped.feed(Odometry(self.k * SECOND, "wheels", self.k, (self.k - 1) * SECOND, distance, turn))

    @property
    def state(self):
        return self.stepped.state

    @property
    def estimate(self):
        return self.stepped.estimate(self.k * SECOND)

    @property
    def position(self):
        return self.estimate.pose[:2]


@pytest.mark.parametrize(
    ("outlier", "counter", "expected"),
    [
        pytest.param(False, 3, (0.75, 0), id="line 1-3: counter at epsilon, no outlier: raise w_wifi, counter 0"),
        pytest.param(False, 9, (0.75, 0), id="line 1-3: counter beyond epsilon"),
        pytest.param(False, 0, (0.5, 0), id="line 4-6: no outlier: one half each, counter 0"),
        pytest.param(False, 2, (0.5, 0), id="line 4-6: counter below epsilon is put back"),
        pytest.param(True, 0, (0.0, 1), id="line 7-9: outlier: odometry alone, counter + 1"),
        pytest.param(True, 3, (0.0, 4), id="line 7-9: outlier, however high the counter"),
    ],
)
def test_algorithm_2_line_by_line(outlier, counter, expected):
    assert allocate(counter, 3, 0.75, outlier=outlier) == expected


def test_algorithm_1_lines_1_and_2_start_with_equal_weights():
    state = Robot().state
    assert (state.wifi_weight, state.odo_counter) == (0.5, 0)


def test_algorithm_1_line_3_moves_from_the_previous_location():
    """From (4, 3): 1 m along x, a quarter turn left, 2 m along y: (5, 5)."""
    robot = Robot()
    robot.drive(1.0)
    robot.drive(0.0, math.pi / 2)
    robot.drive(2.0)
    assert robot.estimate.pose == pytest.approx((5.0, 5.0, math.pi / 2))


def test_algorithm_1_line_4_trilaterates_signal_strengths():
    """P0 = -40 dBm, n = 2. From (4, 3) anchors a and b are 5 m away, c is sqrt(18) m: -40 - 20 log10(d) = -53.979400,
    -53.979400, -52.552725 dBm. Odometry at (4.2, 2.8) is halved with that fix: (4.1, 2.9).
    """
    anchors = [{"id": name, "position_m": list(at)} for name, at in PLACES.items()]
    radio = {"reference_rssi_dbm": -40.0, "path_loss_exponent": 2.0}
    robot = Robot(World.from_table({"anchors": anchors, "radio": radio}), Pose(4.2, 2.8, 0.0))
    strengths = {"a": -53.979400, "b": -53.979400, "c": -52.552725}
    robot.stepped.feed(WifiScan(SECOND, "wifi", 1, tuple(RssiReading(name, dbm) for name, dbm in strengths.items())))
    assert robot.position == pytest.approx((4.1, 2.9), abs=1e-5)


def test_equation_5_by_hand():
    """w_Wi-Fi = 0.75: x = 4 * 0.25 + 4.2 * 0.75 = 4.15, y = 3 * 0.25 + 2.8 * 0.75 = 2.85."""
    assert weighted_average((4.0, 3.0), (4.2, 2.8), 0.75) == pytest.approx((4.15, 2.85))


def test_algorithm_1_lines_5_and_6_weigh_the_fix_in():
    """x = 4 * 0.5 + 4.2 * 0.5 = 4.1, y = 3 * 0.5 + 2.8 * 0.5 = 2.9."""
    robot = Robot()
    fates = robot.scan(*GOOD)
    assert robot.position == pytest.approx((4.1, 2.9))
    assert {(f.decision, f.reason, f.weight) for f in fates} == {(Decision.USED, Reason.OK, 0.5)}
    assert [f.anchor for f in fates] == ["a", "b", "c"]


def test_innovation_is_reading_minus_expectation_at_the_odometry_position():
    """Anchor a at the origin: |(4.2, 2.8)| - |(4, 3)| = 5.04777 - 5."""
    assert Robot().scan(*GOOD)[0].innovation == pytest.approx(math.sqrt(25.48) - 5.0)


def test_an_outlier_leaves_the_position_to_odometry():
    robot = Robot()
    fates = robot.scan(*BAD)
    assert robot.position == START[:2]
    assert {(f.decision, f.reason, f.weight) for f in fates} == {(Decision.REJECTED, Reason.OUTLIER, 0.0)}
    assert robot.state.odo_counter == 1


def test_a_whole_run_worked_out_by_hand():
    """epsilon = 2. Two outliers: (4, 3), counter 2. The next good fix weighs 0.75: 4 + 0.75 * 0.2 = 4.15, 3 - 0.15 =
    2.85, counter 0. The same fix again weighs 0.5: 4.15 + 0.5 * 0.05 = 4.175, 2.85 - 0.025 = 2.825.
    """
    robot, weights = Robot(epsilon=2), []
    for x, y in (BAD, BAD, GOOD, GOOD):
        weights.append(robot.scan(x, y)[0].weight)
        if len(weights) == 3:
            assert robot.position == pytest.approx((4.15, 2.85))
    assert weights == [0.0, 0.0, 0.75, 0.5]
    assert robot.position == pytest.approx((4.175, 2.825))


@pytest.mark.parametrize(("raised", "x"), [(0.5, 4.1), (0.9, 4.18), (1.0, 4.2)])
def test_raised_weight_is_a_choice(raised, x):
    robot = Robot(epsilon=1, raised_weight=raised)
    robot.scan(*BAD)
    robot.scan(*GOOD)
    assert robot.position[0] == pytest.approx(x)


@pytest.mark.parametrize(
    ("relative_to", "limit_m"),
    [
        pytest.param("coordinate", 0.4, id="coordinate: 10 % of x = 4"),
        pytest.param("position", 0.5, id="position: 10 % of |(4, 3)| = 5"),
        pytest.param("travelled", 0.2, id="travelled: 10 % of 1 m forth and 1 m back"),
        pytest.param("floor", 5.0, id="floor: 10 % of the diagonal of 30 m by 40 m"),
    ],
)
def test_what_the_percentage_is_of(relative_to, limit_m):
    decisions = []
    for away in (limit_m - 0.001, limit_m + 0.001):
        robot = Robot(outlier_relative_to=relative_to)
        robot.drive(1.0)
        robot.drive(-1.0)
        decisions.append(robot.scan(4.0 + away, 3.0)[0].decision)
    assert decisions == [Decision.USED, Decision.REJECTED]


def test_one_coordinate_that_differs_too_much_makes_an_outlier():
    """0.35 is less than 10 % of x = 4, more than 10 % of y = 3."""
    assert Robot().scan(4.35, 3.0)[0].decision is Decision.USED
    assert Robot().scan(4.0, 3.35)[0].decision is Decision.REJECTED


def test_outlier_percent_is_a_choice():
    assert Robot(outlier_percent=60.0).scan(*BAD)[0].decision is Decision.USED


@pytest.mark.parametrize(
    ("feedback", "expected"),
    [
        pytest.param(True, (5.15, 2.85), id="from the fused (4.1, 2.9): odometry (5.1, 2.9), halved with (5.2, 2.8)"),
        pytest.param(False, (5.1, 2.9), id="from pure odometry: (5, 3), halved with (5.2, 2.8)"),
    ],
)
def test_feedback_decides_where_an_odometry_step_starts(feedback, expected):
    robot = Robot(feedback=feedback)
    robot.scan(*GOOD)
    robot.drive(1.0)
    robot.scan(5.2, 2.8)
    assert robot.position == pytest.approx(expected)


@pytest.mark.parametrize(("missing", "weight"), [("ignore", 0.5), ("count", 0.75)])
def test_missing_wifi_leaves_the_counter_or_raises_it(missing, weight):
    robot = Robot(missing_wifi=missing, epsilon=1, window_s=0.5)
    fates = robot.scan(*GOOD, names="ab")
    assert {(f.decision, f.reason, f.weight) for f in fates} == {(Decision.UNUSABLE, Reason.TOO_FEW_ANCHORS, 0.0)}
    assert robot.position == START[:2]
    assert robot.scan(*GOOD)[0].weight == weight


def test_each_reading_is_used_once():
    robot = Robot(window_s=10.0)
    reasons = [robot.scan(*GOOD, names=name)[0].reason for name in "abccab"]
    too_few = [Reason.TOO_FEW_ANCHORS] * 2
    assert reasons == [*too_few, Reason.OK, *too_few, Reason.OK]


def shifted_decisions(relative_to, shift):
    """Decisions of one and the same run, 3 m with fixes 0.2, 0.5 and 2 m off, in a world whose origin is elsewhere."""
    places = {name: shift.transform(*place) for name, place in PLACES.items()}
    corner = (-40.0, -40.0)
    robot = Robot(world(places, corner=corner), shift.compose(START), places=places, outlier_relative_to=relative_to)
    decisions = []
    for away in (0.2, 0.5, 2.0):
        robot.drive(1.0)
        x, y = Pose(*robot.estimate.pose).transform(away, 0.0)
        decisions.append(robot.scan(x, y)[0].decision)
    return decisions, shift.inverse().transform(*robot.position)


@pytest.mark.parametrize("relative_to", ["travelled", "floor"])
def test_two_readings_of_the_percentage_do_not_depend_on_the_origin(relative_to):
    plain, where = shifted_decisions(relative_to, Pose(0.0, 0.0, 0.0))
    moved, there = shifted_decisions(relative_to, Pose(100.0, -60.0, 2.2))
    assert moved == plain
    assert there == pytest.approx(where, abs=1e-6)


@pytest.mark.parametrize("relative_to", ["coordinate", "position"])
def test_weakness_of_the_literal_readings_the_origin_decides_what_an_outlier_is(relative_to):
    """2 m off is an outlier at (7, 3) and none at (107, 103), where 10 % is more than 10 m. Same room, same radio."""
    plain, _ = shifted_decisions(relative_to, Pose(0.0, 0.0, 0.0))
    moved, _ = shifted_decisions(relative_to, Pose(100.0, 100.0, 0.0))
    assert plain[-1] is Decision.REJECTED
    assert moved[-1] is Decision.USED


def test_weakness_odometry_that_drifted_too_far_locks_good_fixes_out_for_ever():
    """Believed at (6, 3) but standing at (4, 3): every exact fix is an outlier, whatever the counter."""
    robot = Robot(start=Pose(6.0, 3.0, 0.0))
    decisions = {robot.scan(4.0, 3.0)[0].decision for _ in range(20)}
    assert decisions == {Decision.REJECTED}
    assert robot.state.odo_counter == 20


def test_the_antennas_arm_is_taken_off_with_odometrys_heading():
    """Looking along y from (4, 3), antenna 0.5 m ahead and 0.1 m left: a fix at (3.9, 3.5) agrees with odometry."""
    robot = Robot(world(robot={"antenna_m": [0.5, 0.1, 0.0]}), Pose(4.0, 3.0, math.pi / 2))
    fates = robot.scan(3.9, 3.5)
    assert fates[0].decision is Decision.USED
    assert robot.position == pytest.approx((4.0, 3.0))
    assert [f.innovation for f in fates] == pytest.approx([0.0] * 3, abs=1e-9)


@pytest.mark.parametrize("feedback", [True, False])
def test_unknown_position_starts_at_the_first_fix(feedback):
    nowhere = Pose(math.nan, math.nan, math.nan)
    robot = Robot(start=nowhere, known={"position_known": False, "heading_known": False}, feedback=feedback)
    assert not robot.estimate.valid
    assert np.isfinite(robot.estimate.pose).all()
    assert [f.innovation for f in robot.scan(*GOOD)] == [None] * 3
    assert robot.estimate.valid
    assert not robot.estimate.heading_known
    assert robot.position == pytest.approx(GOOD)
    robot.drive(0.3)
    assert robot.scan(4.5, 2.8)[0].decision is Decision.USED
    assert robot.position == pytest.approx((4.5, 2.8))


@pytest.mark.parametrize("feedback", [True, False])
def test_stretch_without_radio_is_motion_alone(feedback):
    """1 m of a drive of 2 m is closed, after an outlier: weights and counter stay, the rest goes on from there."""
    robot, closed = Robot(feedback=feedback), Robot(feedback=feedback)
    for one in (robot, closed):
        one.scan(*BAD)
        one.drive(1.0, 0.4)
    before = closed.state
    assert closed.stepped.close() == ()
    assert (closed.state.odo_counter, closed.state.wifi_weight) == (before.odo_counter, before.wifi_weight) == (1, 0.0)
    for one in (robot, closed):
        one.drive(1.0)
        one.scan(5.8, 3.6)
    assert closed.estimate.pose == pytest.approx(robot.estimate.pose)
    assert closed.state.travelled_m == robot.state.travelled_m == 2.0


def test_no_covariance_is_claimed():
    assert Robot().estimate.covariance is None


@pytest.mark.parametrize(
    "options",
    [
        {"outlier_percent": 0.0},
        {"outlier_relative_to": "travel"},
        {"missing_wifi": "cuont"},
        {"raised_weight": 0.4},
        {"raised_weight": 1.1},
        {"epsilon": -1},
        {"window_s": -1.0},
    ],
)
def test_impossible_options_are_refused(options):
    with pytest.raises(ParameterError, match=f"dynamic_weight: .*{next(iter(options))}"):
        DynamicWeight(world(), **options)
