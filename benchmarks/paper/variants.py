"""One run in other forms: with its gyro, leg by leg, with another origin, with scans that miss an access point."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np

from fusion import Gyro, Increment, Measurement, Odometry, Pose, Radio, WifiScan, World
from fusion.motion import Integral
from fusion.odometry import Odometer
from logs.run import Run
from sensors.simulation.scenario import Reality

MISSING_SHARE = 0.2
"""Share of scans that lack one access point, in the variant with missing Wi-Fi."""


def without_gyro(run: Run) -> Run:
    """The run of a robot that has none, as the paper's."""
    return replace(run, measurements=tuple(item for item in run.measurements if not isinstance(item, Gyro)))


def with_gyro(run: Run, reality: Reality) -> Run:
    """The run of a robot that takes its turns from the gyro, and knows how good that is."""
    table: dict[str, Any] = json.loads(run.world.table)
    table["robot"]["turn_source"] = "gyro"
    table["robot"]["noise"] |= {
        "turn_std_per_sqrt_rad": 0.0,
        "turn_std_per_sqrt_m": 0.0,
        "turn_std_per_sqrt_s": reality.gyro_noise_std_rad_s / math.sqrt(reality.gyro_hz),
        "turn_scale_std": 0.0,
        "turn_bias_std_rad_s": reality.gyro_bias_std_rad_s,
    }
    return replace(run, world=World.from_table(table))


def leg_by_leg(run: Run) -> Run:
    """The same motion in three increments per scan: turn, go straight, turn.

    For a method that only adds poses this is the same run to rounding, where the robot drives straight between scans
    even to the distance travelled; it is some fifty times shorter.
    """
    assert run.prior is not None
    since_ns, measurements = run.prior.time_ns, list[Measurement]()
    odometer, motion = Odometer(run.world.robot, since_ns), Integral(run.world.robot.noise, Increment())
    for measurement in run.measurements:
        if isinstance(measurement, Radio):
            odometer.hold(measurement.time_ns, motion.extend)
        else:
            odometer.advance(measurement, motion.extend)
        if isinstance(measurement, WifiScan):
            measurements += [*_leg(motion.increment, since_ns, measurement.time_ns), measurement]
            since_ns = measurement.time_ns
            motion.restart(Increment())
    return replace(run, measurements=tuple(measurements))


def _leg(motion: Increment, from_ns: int, until_ns: int) -> list[Odometry]:
    first = math.atan2(motion.y, motion.x) if (motion.x, motion.y) != (0.0, 0.0) else 0.0
    parts = ((0.0, first), (math.hypot(motion.x, motion.y), 0.0), (0.0, motion.heading - first))
    times = [from_ns + (until_ns - from_ns) * i // 3 for i in range(4)]
    return [Odometry(times[i + 1], "wheels", i, times[i], distance, turn) for i, (distance, turn) in enumerate(parts)]


def moved_by(run: Run, offset_m: float | None) -> Run:
    """`moved` along both axes alike; None: until the middle of the floor is the origin."""
    bounds = run.world.bounds
    if offset_m is None:
        return moved(run, -0.5 * (bounds.x_min + bounds.x_max), -0.5 * (bounds.y_min + bounds.y_max))
    return moved(run, offset_m, offset_m)


def moved(run: Run, x: float, y: float) -> Run:
    """The same run in a map whose origin lies elsewhere: (``x``, ``y``) [m] is added to every coordinate."""
    assert run.truth is not None
    assert run.prior is not None
    table: dict[str, Any] = json.loads(run.world.table)
    for anchor in table["anchors"]:
        anchor["position_m"] = [anchor["position_m"][0] + x, anchor["position_m"][1] + y, *anchor["position_m"][2:]]
    for key in table["bounds"]:
        table["bounds"][key] += x if key.startswith("x") else y
    table["walls"] = [[[a + x, b + y] for a, b in wall] for wall in table["walls"]]
    pose = run.prior.pose
    return replace(
        run,
        world=World.from_table(table),
        prior=replace(run.prior, pose=Pose(pose.x + x, pose.y + y, pose.heading)),
        truth=replace(run.truth, x=run.truth.x + x, y=run.truth.y + y),
    )


def missing_wifi(run: Run, seed: int) -> Run:
    """The run with one access point, drawn at random, missing from a fifth of the scans: those give no fix."""
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))

    def damaged(measurement: Measurement) -> Measurement:
        if not isinstance(measurement, WifiScan):
            return measurement
        lost, which = random.random(), int(random.integers(len(measurement.readings)))
        if lost >= MISSING_SHARE:
            return measurement
        return replace(measurement, readings=measurement.readings[:which] + measurement.readings[which + 1 :])

    return replace(run, measurements=tuple(map(damaged, run.measurements)))
