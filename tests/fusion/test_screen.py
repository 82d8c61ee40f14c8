"""Measurements that no estimator should see have a fate with the reason."""

import math

from fusion import Decision, Gyro, Odometry, RangeReading, Ranges, Reason, RssiReading, WifiScan, build, track
from tests.fusion.streams import prior, world

SECOND = 1_000_000_000


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


def test_unusable_readings_are_named_one_by_one():
    bad = (
        RssiReading("a", math.nan),
        RssiReading("zz", -50.0),
        RssiReading("b", 127.0),
        RssiReading("c", -60.0, 10 * SECOND),
    )
    reasons = [reason for _, _, reason in fates_of(WifiScan(11 * SECOND, "wifi", 0, bad), "ekf")]
    assert reasons == [Reason.NOT_FINITE, Reason.UNKNOWN_ANCHOR, Reason.OUT_OF_RANGE, Reason.STALE]
