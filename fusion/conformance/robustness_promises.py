"""Promises of robustness: lost sensors, outliers, silence of the radio, and names of anchors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from fusion.conformance.folds import EXACT_M, NEAR_M, NOISELESS, NOISY, at, brief, distance, updates_of
from fusion.conformance.promise import Promise, promise, require
from fusion.conformance.synthetic_run import SyntheticRun, with_outlier, without
from fusion.estimator import Tag
from fusion.values import nanoseconds

PROMISES: list[Promise] = []


@promise(PROMISES, "any-sensor-out", "Any one sensor may drop out.")
def _any_sensor_out(made: type[Any]) -> None:
    for sensor in ("wheels", "uwb", "wifi", "gyro"):
        for update in updates_of(made, NOISELESS, without(NOISELESS.measurements(), sensor)):
            require(
                not update.estimate.valid or all(map(math.isfinite, update.estimate.pose)),
                f"without {sensor!r}, {at(update)} the pose is {brief(update.estimate)}",
            )


@promise(PROMISES, "names-mean-nothing", "Anchors may have any names.", unless=[Tag.STOCHASTIC])
def _names_mean_nothing(made: type[Any]) -> None:
    renamed = replace(NOISY, anchor_names=("z", "m", "k", "b"))
    for one, other in zip(updates_of(made, NOISY), updates_of(made, renamed), strict=True):
        off = distance(one.estimate.pose, other.estimate.pose)
        require(off < EXACT_M, f"{at(one)} renamed anchors move the pose by {off:.3g}")


@promise(
    PROMISES,
    "outlier-is-bounded",
    "One absurd reading moves the answer boundedly.",
    unless=[Tag.NOT_ROBUST, Tag.NO_RADIO],
)
def _outlier_is_bounded(made: type[Any]) -> None:
    honest, measurements = updates_of(made, NOISELESS), NOISELESS.measurements()
    for range_m in (50.0, 1e6):
        damaged = updates_of(made, NOISELESS, with_outlier(measurements, 20, range_m))
        for one, other in zip(honest, damaged, strict=True):
            off = distance(one.estimate.pose, other.estimate.pose, heading=False)
            require(off < 2.0 * NEAR_M, f"one range of {range_m:g} m moves the pose by {off:.3g} m {at(one)}")


@promise(
    PROMISES, "radio-silence", "Minutes without radio stay finite, and uncertainty grows.", unless=[Tag.NO_COVARIANCE]
)
def _radio_silence(made: type[Any]) -> None:
    quiet = SyntheticRun(130.0, odometry_hz=2, radio_until_s=10.0)
    updates = updates_of(made, quiet)
    before = next(update.estimate for update in updates if update.estimate.time_ns >= nanoseconds(10.0))
    last = updates[-1].estimate
    if last.valid and before.covariance and last.covariance:
        spreads = [one.xx + one.yy for one in (before.covariance, last.covariance)]
        require(
            math.isfinite(spreads[1]) and spreads[1] > spreads[0],
            f"position variance was {spreads[0]:.6g} m² at 10 s, and is {spreads[1]:.6g} after 120 s of silence",
        )
    require(not last.valid or all(map(math.isfinite, last.pose)), f"after 120 s of silence the pose is {last.pose}")
