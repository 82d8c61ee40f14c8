"""Particle filter: the belief is a cloud of weighted poses, so it may have any shape, also several places at once.

Each particle carries its own calibration error of the odometry. The cloud moves once per radio epoch, through the
pre-integrated increment; readings weigh it with a mixture that forgives outliers; it is resampled systematically when
fewer than half the particles still count (Thrun, Burgard & Fox 2005, sections 4.3 and 8.3; Kong, Liu & Wong 1994 for
the effective number). Resampled particles are spread by the kernel of Liu & West (2001), which keeps mean and
covariance, so that calibration errors, which nothing else moves, do not die out.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from fusion import (
    Covariance,
    Estimate,
    Fate,
    Increment,
    ParameterError,
    Particles,
    Pose,
    Prior,
    Radio,
    Tag,
    World,
    compose,
    generator,
    radio_readings,
)
from fusion.arrays import Floats
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.correlated_error import repeated_variance, require_max_correlated
from fusion.fates import judged
from fusion.weighted_points import mixture, moments, square_root

KERNEL = 0.1
"""Width of the resampling kernel as a share of the cloud's own standard deviation (Liu & West: small, e.g. 0.1)."""
BANDWIDTH = 0.3
"""Extent of the place a particle stands for, as a share of the cloud's standard deviation: a wide cloud is thin, so a
sharp reading is taken as blunt until the cloud has gathered (pre-regularisation: Musso, Oudjane & Le Gland 2001).
"""
X, Y, HEADING, DISTANCE_ERROR, TURN_ERROR, TURN_BIAS = range(6)
"""Rows of the cloud: pose [m, m, rad], relative errors of distance and turn, bias of the turn rate [rad/s]."""


class State(NamedTuple):
    """The cloud with its moments, and the path driven since the last scan; arrays are never written to."""

    seed: int
    cloud: Floats
    weights: Floats
    pose: Pose
    covariance: Covariance
    path_m: float


class Particle:
    """Particle filter.

    Parameters
    ----------
    particles
        How many; time and memory grow in proportion.
    outlier_share
        Share of readings expected to be outliers, in (0, 1).
    max_correlated
        How many neighbouring signal strengths of an anchor at most are taken to share one error, that of the place. 1
        takes all as independent; more is more honest where shadowing is strong, and slower to correct odometry. None:
        20 where the world states its `shadowing_length_m`, else 3.
    """

    summary: ClassVar[str] = "particle filter with an outlier mixture; starts from anywhere"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.STOCHASTIC, Tag.GLOBAL_START, Tag.HEADING_START})

    def __init__(
        self, world: World, *, particles: int = 1000, outlier_share: float = 0.05, max_correlated: float | None = None
    ) -> None:
        if particles < 1:
            raise ParameterError(f"particle: particles is {particles}; give at least 1")
        if not 0.0 < outlier_share < 1.0:
            raise ParameterError(f"particle: outlier_share is {outlier_share}; give a share between 0 and 1")
        self._world = world
        self._count = particles
        self._outlier_share = outlier_share
        self._max_correlated = require_max_correlated("particle", max_correlated)

    def start(self, prior: Prior, seed: int) -> State:
        """A cloud drawn from the prior; uniform over the floor, or all headings, where that is unknown."""
        random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
        noise, bounds = self._world.robot.noise, self._world.bounds
        cloud = random.standard_normal((6, self._count))
        pose, covariance = starting_belief(self._world, prior)
        cloud[:3] = np.array(pose)[:, None] + square_root(np.array(covariance.matrix)) @ cloud[:3]
        calibration = np.array([noise.distance_scale_std, noise.turn_scale_std, noise.turn_bias_std_rad_s])
        cloud[3:] *= calibration[:, None]
        if not prior.position_known:
            cloud[X] = random.uniform(bounds.x_min, bounds.x_max, self._count)
            cloud[Y] = random.uniform(bounds.y_min, bounds.y_max, self._count)
        if not prior.heading_known:
            cloud[HEADING] = random.uniform(-math.pi, math.pi, self._count)
        weights = np.full(self._count, 1.0 / self._count)
        return State(seed, cloud, weights, *moments(weights, *cloud[:3]), 0.0)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Move the cloud, and weigh it by the readings."""
        who = (motion.time_ns,) if scan is None else (scan.time_ns, scan.sensor, scan.seq)
        random = generator(state.seed, *who)
        cloud, path_m = moved(state.cloud, motion, random), state.path_m + motion.path_m
        if scan is None:
            return State(state.seed, cloud, state.weights, *moments(state.weights, *cloud[:3]), path_m), ()
        return self._weighed(state._replace(cloud=cloud, path_m=path_m), scan, random)

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """Mean and covariance of the cloud, after the motion since."""
        pose, covariance = compose(state.pose, state.covariance, motion)
        return Estimate(time_ns, pose, covariance, heading_known=covariance.hh < HEADING_KNOWN_STD**2)

    def particles(self, state: State) -> Particles:
        """The cloud."""
        return Particles(state.cloud[:2].T, state.weights)

    def _weighed(self, state: State, scan: Radio, random: np.random.Generator) -> tuple[State, tuple[Fate, ...]]:
        """The state after the readings of a scan; its moments are still those of before the motion."""
        cloud, weights = state.cloud, state.weights
        pose, covariance = moments(weights, *cloud[:3])
        antenna_m, fates, log_weights = self._world.robot.antenna_m, [], np.log(weights)
        for reading in radio_readings(self._world, scan):
            expected = reading.expected_values(cloud[X], cloud[Y], cloud[HEADING], antenna_m)
            between = float(weights @ np.square(expected - weights @ expected))
            spread = repeated_variance(reading, state.path_m, self._max_correlated)
            variance = spread + BANDWIDTH**2 * between
            likelihood, good = mixture(reading.value - expected, variance, self._outlier_share)
            log_weights = log_weights + np.log(likelihood)
            share = min(float(weights @ good), 1.0)
            fates.append(judged(scan, reading, pose, covariance, antenna_m, share))
        weights = np.exp(log_weights - log_weights.max())
        weights = np.maximum(weights / weights.sum(), np.finfo(float).tiny)
        if 1.0 / float(weights @ weights) < 0.5 * self._count:
            cloud, weights = resampled(cloud, weights, random)
        return State(state.seed, cloud, weights, *moments(weights, *cloud[:3]), 0.0), tuple(fates)


def moved(cloud: Floats, motion: Increment, random: np.random.Generator) -> Floats:
    """The cloud (6, n) after ``motion``, each particle with its own calibration error and its own noise."""
    if motion.duration_s == 0.0:
        return cloud
    noise = square_root(np.array(motion.covariance.matrix)) @ random.standard_normal((3, cloud.shape[1]))
    forward, left, turn = motion.corrected(*cloud[3:])
    forward, left = forward + noise[0], left + noise[1]
    c, s = np.cos(cloud[HEADING]), np.sin(cloud[HEADING])
    after = cloud.copy()
    after[X] += c * forward - s * left
    after[Y] += s * forward + c * left
    after[HEADING] += turn + noise[2]
    return after


def resampled(cloud: Floats, weights: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """As many particles of equal weight: systematic resampling, then the moment-preserving kernel of Liu & West."""
    count = len(weights)
    positions = (random.random() + np.arange(count)) / count
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), positions), count - 1)
    centre = np.sum(cloud * weights, axis=1)
    centre[HEADING] = moments(weights, *cloud[:3])[0].heading
    away = cloud[:, chosen] - centre[:, None]
    away[HEADING] = np.remainder(away[HEADING] + math.pi, math.tau) - math.pi
    kernel = square_root(away @ away.T / count) @ random.standard_normal(away.shape)
    spread = math.sqrt(1.0 - KERNEL**2) * away + KERNEL * kernel
    return centre[:, None] + spread, np.full(count, 1.0 / count)
