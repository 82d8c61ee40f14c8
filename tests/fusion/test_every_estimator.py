"""Every installed estimator on one drive: order, accuracy, fates, silence, a moved world, a gyro that is not used."""

import math
import random

import numpy as np
import pytest

import fusion
from fusion import Decision, Gyro, Odometry, Pose, Prior, Ranges, Reason, World, build, digest, final, track
from tests.fusion.streams import ANCHORS, drive, prior, world

SECOND = 1_000_000_000
NAMES = [name for name in fusion.names() if name != "nearest"]


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
