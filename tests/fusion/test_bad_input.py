"""What is malformed is refused with one sentence, never with a traceback and never with a wild answer."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fusion import (
    BeliefError,
    Covariance,
    MeasurementError,
    MotorCommand,
    Odometry,
    Pose,
    Prior,
    RangeReading,
    Ranges,
    Reason,
    Tag,
    WheelTicks,
    World,
    WorldError,
    build,
    digest,
    load,
    names,
    track,
)
from fusion.conformance.synthetic_run import SyntheticRun

ANCHORS = [{"id": "a", "position_m": [0, 0]}, {"id": "b", "position_m": [5, 0]}, {"id": "c", "position_m": [0, 5]}]
BOUNDS = "[bounds]\nx_min = 0\nx_max = 1\ny_min = 0\ny_max = 1\n"


def fold(*measurements, robot=None):
    world = World.from_table({"anchors": ANCHORS, "robot": robot or {}})
    return list(track(build("dead_reckoning", world), world, measurements, SyntheticRun().prior()))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"anchors": ANCHORS, "radio": 3}, "radio: expected a table"),
        ({"anchors": [ANCHORS[0] | {"ranging": 3}]}, r"anchors\[0\].ranging: expected a table"),
        ({"anchors": ANCHORS, "radio": {"shadowing_std_db": 10**400}}, "is not a finite number"),
    ],
)
def test_table_of_the_wrong_shape_is_named(table, message):
    with pytest.raises(WorldError, match=message):
        World.from_table(table)


@pytest.mark.parametrize(
    "text", [f"provenance = 1979-05-27\n{BOUNDS}", f"{BOUNDS}[radio]\nfrequency_hz = 1979-05-27\n"]
)
def test_date_in_a_world_file_is_refused(text):
    with pytest.raises(WorldError, match="expected"):
        World.from_toml(text)


@pytest.mark.parametrize(
    "wrong", [WheelTicks(1, "wheels", 1, (1,)), WheelTicks(1, "wheels", 1, ()), MotorCommand(1, "motors", 1, (0.1,))]
)
def test_wrong_number_of_wheels_is_refused_with_both_numbers(wrong):
    with pytest.raises(MeasurementError, match=r"has \d wheels, the world's skid_steer drive has 4"):
        fold(wrong)


def test_odometry_that_ends_before_it_begins_is_refused_and_moves_nothing():
    backwards = Odometry(10**9, "wheels", 1, 2 * 10**9, 1.0, 0.0)
    updates = fold(backwards, Ranges(11 * 10**8, "uwb", 1, (RangeReading("a", 1.0),)))
    assert [fate.reason for fate in updates[0].fates] == [Reason.BAD_CLOCK]
    assert updates[-1].estimate.pose == SyntheticRun().pose(0)


def test_encoder_that_starts_over_loses_one_message_and_no_more():
    robot = {"drive": "differential", "ticks_per_revolution": 100, "wheel_circumference_m": 1.0}
    counts = [1000, 1010, 0, 10, 20]
    ticks = [WheelTicks((i + 1) * 10**8, "wheels", i, (count, count)) for i, count in enumerate(counts)]
    driven = fold(*ticks, robot=robot)[-1].estimate.pose.x - SyntheticRun().pose(0).x
    assert driven == pytest.approx(0.3)


START = Prior(0, Pose(1.0, 2.0, 0.5), Covariance.from_std(0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": Pose(math.nan, 2.0, 0.5)}, "prior: x is nan, no finite number"),
        ({"pose": Pose(1.0, -math.inf, 0.5)}, "prior: y is -inf"),
        ({"pose": Pose(1.0, 2.0, math.nan)}, "prior: heading is nan.* heading_known=False"),
        ({"pose": Pose(math.nan, 2.0, 0.5), "heading_known": False}, "prior: x is nan.* position_known=False"),
        ({"pose": Pose(1.0, 2.0, None)}, "prior: heading is None"),
        (
            {"covariance": Covariance(0.1, math.nan, 0.0, 0.1, 0.0, 0.1)},
            "prior: the covariance of x and y is nan, no finite number",
        ),
        ({"covariance": Covariance(-0.1, 0.0, 0.0, 0.1, 0.0, 0.1)}, "prior: the variance of x is -0.1, below zero"),
        ({"covariance": Covariance(0.1, 0.2, 0.0, 0.1, 0.0, 0.1)}, "prior: x and y have a covariance of 0.2"),
        ({"covariance": Covariance(1.0, 0.9, 0.9, 1.0, -0.9, 1.0)}, "prior: correlations of .* exclude each other"),
        ({"covariance": np.eye(3)}, "is no fusion.Covariance; Covariance.from_matrix makes one"),
    ],
)
def test_prior_that_no_estimator_could_start_from_is_refused_by_name(change, message):
    with pytest.raises(BeliefError, match=message):
        replace(START, **change)


def test_prior_may_leave_open_what_is_not_known_whatever_its_numbers():
    spoilt = Covariance(1.0, 0.0, 9.0, 1.0, 0.0, -1.0)
    assert replace(START, covariance=spoilt, heading_known=False).covariance is spoilt
    assert not replace(START, pose=Pose(1.0, 2.0, math.nan), heading_known=False).heading_known
    nowhere, nothing = Pose(*[math.nan] * 3), Covariance(*[math.nan] * 6)
    assert replace(START, pose=nowhere, covariance=nothing, position_known=False, heading_known=False).pose is nowhere


@pytest.mark.parametrize("name", [name for name in names() if Tag.HEADING_START in load(name).tags])
def test_estimator_that_starts_without_a_heading_reads_none_of_its_numbers(name):
    place, start = SyntheticRun().world(), replace(SyntheticRun().prior(), heading_known=False)
    hollow = replace(
        start,
        pose=start.pose._replace(heading=math.nan),
        covariance=start.covariance._replace(xh=math.nan, yh=math.nan, hh=math.nan),
    )
    with_any, with_none = (
        digest(track(build(name, place), place, SyntheticRun().measurements(), prior, seed=1))
        for prior in (start, hollow)
    )
    assert with_any == with_none
