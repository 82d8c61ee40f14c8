"""The drive that every speed is measured on: odometry at 100 Hz, ranges to three anchors at 5 Hz.

A figure of eight of two circles, 2 m in radius each, at 0.5 m/s: as long as is asked for, within a few metres.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fusion import Covariance, Measurement, Odometry, OdometryNoise, Pose, Prior, RangeReading, Ranges, Truth, World
from fusion.arrays import Floats
from fusion.values import nanoseconds, seconds
from logs.run import Run
from logs.truth import TruthTrack
from logs.writer import RunWriter

START_NS = nanoseconds(1.0)
STEP_NS = nanoseconds(0.01)
STEPS_PER_SCAN = 20
STEPS_PER_TRUTH = 10
STEPS_PER_CIRCLE = 2500
STEP_M = 0.005
GREATEST_NOISE = 2.5
"""Noise of ranges ends at so many standard deviations: no gate refuses one, so filters without a gate answer alike."""
RANGE_STD_M = 0.1
PRIOR_COVARIANCE = Covariance(0.01, 0.0, 0.0, 0.01, 0.0, 0.0025)


class Block(NamedTuple):
    """The odometry between two scans, and the scan at its end."""

    steps: tuple[Odometry, ...]
    scan: Ranges

    @property
    def measurements(self) -> tuple[Measurement, ...]:
        """All of them, in order."""
        return (*self.steps, self.scan)


class Drive(NamedTuple):
    """A drive through ``world`` from ``prior``; ``poses`` (n, 3) [m, m, rad] are the true ones at the n scans."""

    world: World
    prior: Prior
    blocks: tuple[Block, ...]
    poses: Floats

    @property
    def measurements(self) -> tuple[Measurement, ...]:
        """All of them, in the order of arrival."""
        return tuple(one for block in self.blocks for one in block.measurements)


def site(anchors: int = 3, *, calibrated: bool = False) -> World:
    """A world of so many ``anchors`` around the drive, the nearest last in order. ``calibrated``: nothing but white
    noise is left in odometry and ranges, so that a filter of the pose alone is the right one.
    """
    angles = 2.4 * np.arange(anchors)  # about the golden angle: never two in one place
    radii = 8.0 + 0.05 * np.arange(anchors)
    places = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]).tolist()
    white = {"distance_scale_std": 0.0, "turn_scale_std": 0.0, "turn_bias_std_rad_s": 0.0}
    return World.from_table(
        {
            "name": "drive",
            "anchors": [{"id": f"a{anchors - k:03d}", "position_m": place} for k, place in enumerate(places)],
            "ranging": {"std_m": RANGE_STD_M, **({"bias_std_m": 0.0, "scale_std": 0.0} if calibrated else {})},
            "robot": {"noise": white if calibrated else {}},
        }
    )


def drive(duration_s: float, world: World, *, received: int = 3, seed: int = 0) -> Drive:
    """A drive of that length, at least two scans, in which the nearest ``received`` anchors answer every scan."""
    scans = max(round(duration_s / seconds(STEPS_PER_SCAN * STEP_NS)), 2)
    true = _true_poses(scans * STEPS_PER_SCAN)
    poses = true[STEPS_PER_SCAN::STEPS_PER_SCAN]
    random = np.random.default_rng(seed)
    steps, ranges = _odometry(world, len(true) - 1, random), _ranges(world, poses, received, random)
    blocks = tuple(
        Block(tuple(steps[k * STEPS_PER_SCAN : (k + 1) * STEPS_PER_SCAN]), scan) for k, scan in enumerate(ranges)
    )
    return Drive(world, Prior(START_NS, Pose(*true[0].tolist()), PRIOR_COVARIANCE), blocks, poses)


def as_run(driven: Drive) -> Run:
    """The drive as a run in memory, with its truth at 10 Hz."""
    true = _true_poses(len(driven.blocks) * STEPS_PER_SCAN)[::STEPS_PER_TRUTH]
    time_ns = START_NS + STEP_NS * STEPS_PER_TRUTH * np.arange(len(true), dtype=np.int64)
    return Run(
        path=Path("drive.mcap"),
        name="drive",
        world=driven.world,
        prior=driven.prior,
        metadata={"source": "simulated"},
        measurements=driven.measurements,
        truth=TruthTrack(time_ns, *true.T),
        warnings=(),
        lanes={},
    )


def write_log(run: Run, path: Path) -> int:
    """The run as a log at ``path``, in order of time; answers how many messages that holds."""
    truth = run.truth or TruthTrack.from_truths([])
    columns = (truth.time_ns, truth.x, truth.y, truth.heading)
    truths = [Truth(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    messages = sorted([*truths, *run.measurements], key=lambda message: message.time_ns)
    with RunWriter(path, run.world, name=path.stem, prior=run.prior, metadata=run.metadata) as log:
        for message in messages:
            log.write_truth(message) if isinstance(message, Truth) else log.write(message)
    return len(messages)


def step_variances(noise: OdometryNoise, step: Odometry) -> tuple[float, float, float]:
    """Variances of the noise of one step: forward [m^2], sideways [m^2], turn [rad^2], by `fusion.OdometryNoise`.

    They are worked out apart from the host, for the other side of the comparison.
    """
    path_m, turn_rad, duration_s = abs(step.distance_m), abs(step.turn_rad), seconds(step.time_ns - step.from_ns)
    return (
        noise.distance_std_per_sqrt_m**2 * path_m + noise.distance_std_per_sqrt_s**2 * duration_s,
        noise.side_std_per_sqrt_m**2 * path_m,
        noise.turn_std_per_sqrt_rad**2 * turn_rad
        + noise.turn_std_per_sqrt_m**2 * path_m
        + noise.turn_std_per_sqrt_s**2 * duration_s,
    )


def _true_poses(steps: int) -> Floats:
    """Poses (steps + 1, 3): circles to the left and to the right in turn; the mid-point rule has no error in them."""
    turns = np.where(np.arange(steps) // STEPS_PER_CIRCLE % 2, -1.0, 1.0) * math.tau / STEPS_PER_CIRCLE
    headings = np.concatenate([[0.0], np.cumsum(turns)])
    middles = headings[:-1] + 0.5 * turns
    x, y = (np.concatenate([[0.0], np.cumsum(STEP_M * of(middles))]) for of in (np.cos, np.sin))
    return np.column_stack([x, y, headings])


def _odometry(world: World, count: int, random: np.random.Generator) -> list[Odometry]:
    turns = np.diff(_true_poses(count)[:, 2])
    whole = Odometry(START_NS + STEP_NS, "wheels", 0, START_NS, STEP_M, float(turns[0]))
    forward, _, turn = step_variances(world.robot.noise, whole)
    distances = STEP_M + math.sqrt(forward) * random.standard_normal(count)
    noisy_turns = turns + math.sqrt(turn) * random.standard_normal(count)
    return [
        Odometry(START_NS + (k + 1) * STEP_NS, "wheels", k, START_NS + k * STEP_NS, distance, turned)
        for k, (distance, turned) in enumerate(zip(distances.tolist(), noisy_turns.tolist(), strict=True))
    ]


def _ranges(world: World, poses: Floats, received: int, random: np.random.Generator) -> list[Ranges]:
    anchors = world.anchors[-received:]
    places = np.array([(anchor.x, anchor.y) for anchor in anchors])
    exact = np.linalg.norm(poses[:, None, :2] - places, axis=2)
    noise = np.clip(random.standard_normal(exact.shape), -GREATEST_NOISE, GREATEST_NOISE)
    return [
        Ranges(
            START_NS + (k + 1) * STEPS_PER_SCAN * STEP_NS,
            "uwb",
            k,
            tuple(RangeReading(anchor.id, value) for anchor, value in zip(anchors, row, strict=True)),
        )
        for k, row in enumerate((exact + RANGE_STD_M * noise).tolist())
    ]
