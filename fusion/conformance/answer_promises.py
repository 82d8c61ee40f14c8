"""Promises of the form of answers: fates, estimates, covariances, headings, particles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fusion.conformance.folds import EXACT_M, NOISY, SEED, at, brief, require_same, updates_of
from fusion.conformance.promise import Promise, promise, require
from fusion.conformance.synthetic_run import SyntheticRun
from fusion.estimator import ParticleEstimator, Particles, Tag
from fusion.fold import Update
from fusion.tracker import Tracker
from fusion.values import Radio

PROMISES: list[Promise] = []
NEAR_SHARE = 0.1
"""Largest distance of the mean of particles from the estimate, as a share of their spread: the motion since the last
reading may have moved each by itself, and the estimate as one.
"""


@promise(PROMISES, "every-fate", "Every reading has one Fate that states what became of it.")
def _every_fate(made: type[Any]) -> None:
    for update in updates_of(made, NOISY):
        scan = update.measurement
        if not isinstance(scan, Radio):
            continue
        received, judged = sorted(r.anchor for r in scan.readings), sorted(fate.anchor for fate in update.fates)
        require(received == judged, f"{at(update)} anchors {received} were received, but fates are of {judged}")
        for fate in update.fates:
            who = (fate.time_ns, fate.sensor, fate.seq)
            require(
                who == (scan.time_ns, scan.sensor, scan.seq),
                f"{at(update)} a fate is signed {who}, its scan {(scan.time_ns, scan.sensor, scan.seq)}",
            )


@promise(PROMISES, "fate-numbers", "A weight is a share, and a NIS is innovation² over its variance.")
def _fate_numbers(made: type[Any]) -> None:
    for update in updates_of(made, NOISY):
        for fate in update.fates:
            whose = f"{at(update)} the fate of {fate.anchor or fate.sensor!r}"
            require(0.0 <= fate.weight <= 1.0, f"{whose} has weight {fate.weight}")
            if fate.nis is None:
                continue
            innovation, variance = fate.innovation, fate.innovation_variance
            require(
                innovation is not None and variance is not None and variance > 0.0,
                f"{whose} has NIS {fate.nis} with innovation {innovation} and variance {variance}",
            )
            expected = (innovation or 0.0) ** 2 / (variance or math.inf)
            require(
                math.isclose(fate.nis, expected, rel_tol=1e-6, abs_tol=1e-12),
                f"{whose} has NIS {fate.nis:.6g}, but innovation² / variance is {expected:.6g}",
            )


@promise(PROMISES, "honest-form", "An estimate is of the time asked for, finite, and numbered as it should be.")
def _honest_form(made: type[Any]) -> None:
    resets = 0
    for update in updates_of(made, NOISY):
        estimate = update.estimate
        require(estimate.time_ns == update.measurement.time_ns, f"{at(update)} the estimate has another time")
        require(all(map(math.isfinite, estimate.pose)) or not estimate.valid, f"{at(update)} {brief(estimate)}")
        lost = estimate.p_lost
        require(lost is None or 0.0 <= lost <= 1.0, f"{at(update)} p_lost is {lost}")
        require(estimate.reset_count >= resets, f"{at(update)} reset_count fell to {estimate.reset_count}")
        resets = estimate.reset_count


@promise(PROMISES, "covariance", "A covariance is finite and positive semi-definite, or None where none is claimed.")
def _covariance(made: type[Any]) -> None:
    claims_none = Tag.NO_COVARIANCE in made.tags
    for update in updates_of(made, NOISY):
        estimate = update.estimate
        if not estimate.valid:
            continue
        given, tagged = "a covariance" if estimate.covariance else "None", "there" if claims_none else "not"
        require(
            (estimate.covariance is None) == claims_none,
            f"{at(update)} the covariance is {given}, and the tag no_covariance is {tagged}",
        )
        if estimate.covariance is not None:
            matrix = np.array(estimate.covariance.matrix)
            require(np.isfinite(matrix).all(), f"{at(update)} the covariance is {estimate.covariance}")
            lowest = float(np.linalg.eigvalsh(matrix)[0])
            require(lowest >= -1e-9 * np.trace(matrix), f"{at(update)} the covariance has eigenvalue {lowest:.6g}")


@promise(PROMISES, "heading-range", "A heading lies in (-pi, pi].")
def _heading_range(made: type[Any]) -> None:
    for update in updates_of(made, SyntheticRun(duration_s=60.0)):
        heading = update.estimate.pose.heading
        require(-math.pi < heading <= math.pi, f"{at(update)} the heading is {heading:.6g}")


@promise(
    PROMISES,
    "particles",
    "Particles are the belief itself, and showing them changes nothing.",
    offers=ParticleEstimator,
)
def _particles(made: type[Any]) -> None:
    world = NOISY.world()
    estimator = made(world)
    tracker, asked = Tracker(estimator, world, NOISY.prior(), seed=SEED), list[Update]()
    for measurement in NOISY.measurements():
        asked += tracker.push(measurement)
        shown = tracker.particles()
        if shown is not None and asked[-1].epochs:
            _be_the_belief(shown, asked[-1])
    require_same(updates_of(made, NOISY), asked, "showing the particles changed the answer")


def _be_the_belief(shown: Particles, update: Update) -> None:
    """Points with weights that sum to one, about the estimate."""
    positions, weights = shown
    require(
        weights.ndim == 1 and len(weights) > 0 and positions.shape == (len(weights), 2),
        f"{at(update)} positions have shape {positions.shape}, weights {weights.shape}; (n, 2) and (n,) are asked for",
    )
    require(np.isfinite(positions).all(), f"{at(update)} a particle's position is not finite")
    require(
        (weights >= 0.0).all() and math.isclose(weights.sum(), 1.0, rel_tol=1e-6),
        f"{at(update)} the weights are {weights.min():.6g} to {weights.max():.6g}, and sum to {weights.sum():.9g}",
    )
    mean, here = weights @ positions, update.estimate.pose[:2]
    spread = math.sqrt(float(weights @ np.square(positions - mean).sum(axis=1)))
    off = math.dist(mean, here)
    require(
        off < NEAR_SHARE * spread + EXACT_M or not update.estimate.valid,
        f"{at(update)} the particles' mean is {off:.3g} m from the estimate, and they spread over {spread:.3g} m",
    )
