"""What became of the readings, turned into columns: nothing is lost, neither on the way nor in a store."""

import numpy as np

from benchmarks.metrics.estimate_track import Track
from benchmarks.metrics.fates import DECISIONS, KINDS, REASONS, FateColumns, fates_per_update
from benchmarks.runner.archive import from_bytes, to_bytes
from fusion import Decision, Estimate, Fate, Gyro, Odometry, Pose, Ranges, Reason, Update, WifiScan

TAKEN, GATED = (Decision.USED, Reason.OK), (Decision.REJECTED, Reason.GATE)
IGNORED = (Decision.UNUSABLE, Reason.KIND_NOT_CONSUMED)
FATES = (
    Fate(1, "wifi", 1, "b", *TAKEN, 0.75, 1.5, 4.0, 0.5625),
    Fate(1, "wifi", 1, "a", *GATED, 0.0, nis=12.0),
    Fate(3, "gyro", 7, "", *IGNORED, 0.0),
    Fate(4, "uwb", 1, "b", *TAKEN, 1.0),
)


def updates():
    measurements = (WifiScan(1, "wifi", 1, ()), Odometry(2, "w", 1, 1, 0.0, 0.0), Gyro(3, "gyro", 7, 0.0))
    told = (FATES[:2], (), FATES[2:3], FATES[3:])
    estimate = Estimate(0, Pose(1.0, 2.0, 3.0), None)
    pairs = zip((*measurements, Ranges(4, "uwb", 1, ())), told, strict=True)
    return [Update(measurement, estimate._replace(time_ns=measurement.time_ns), fates) for measurement, fates in pairs]


def row(columns, i):
    names, numbers = columns.names, (columns.weight, columns.innovation, columns.innovation_variance, columns.nis)
    who = int(columns.time_ns[i]), str(names[columns.sensor[i]]), str(names[columns.anchor[i]])
    verdict = DECISIONS[columns.decision[i]], REASONS[columns.reason[i]]
    return *who, *verdict, *(None if np.isnan(column[i]) else float(column[i]) for column in numbers)


def test_columns_keep_what_the_fates_say():
    columns = FateColumns.of(updates())
    assert [row(columns, i) for i in range(4)] == [fate[:2] + fate[3:] for fate in FATES]
    assert [KINDS[kind] for kind in columns.kind] == [WifiScan, WifiScan, Gyro, Ranges]
    assert fates_per_update(updates()).tolist() == [2, 0, 1, 1]


def test_reading_goes_by_its_anchor_and_without_one_by_its_sensor():
    columns = FateColumns.of(updates())
    assert columns.names[columns.source].tolist() == ["b", "a", "gyro", "b"]


def test_readings_are_chosen_by_what_they_met():
    columns = FateColumns.of(updates())
    assert columns.met(Decision.USED).tolist() == [True, False, False, True]
    assert columns.met(Reason.GATE, Reason.KIND_NOT_CONSUMED).tolist() == [False, True, True, False]
    assert columns.counts == {"used": 2, "downweighted": 0, "rejected": 1, "late": 0, "unusable": 1}


def test_store_gives_back_the_same_columns_and_none_are_columns_too():
    for told in (updates(), []):
        track, fates = Track.of(told), FateColumns.of(told)
        stored = from_bytes(to_bytes(track, fates))
        for before, after in zip((*track, *fates), (*stored[0], *stored[1]), strict=True):
            assert before.dtype == after.dtype
            assert np.array_equal(before, after, equal_nan=before.dtype.kind == "f")
