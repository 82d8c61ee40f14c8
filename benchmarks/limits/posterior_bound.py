"""Posterior Cramer-Rao bound, which no filter can beat on one run (Tichavsky, Muravchik & Nehorai 1998).

For additive Gaussian noise the recursion of the information J is

    J <- (F J^-1 Fᵀ + G Q Gᵀ)^-1 + sum of Hᵀ R^-1 H        Jacobians at the truth

and is kept here as the covariance J^-1, which lets Q and the prior be singular. It is written as an estimator that
knows the truth, so that the host gives it exactly what it gives every other: readings screened and put in order,
ticks and gyro as odometry, motion held up to each reading. State: pose, and the errors that the world states to stay
the same for a whole run: odometry's calibration, the gain of each radio, the common error of each anchor.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fusion import (
    Covariance,
    Estimate,
    Fate,
    Increment,
    LogError,
    Pose,
    Prior,
    Radio,
    Tag,
    Tracker,
    World,
    move,
    radio_readings,
)
from fusion.arrays import Floats
from fusion.belief import starting_belief
from fusion.timeline import order
from logs.prior import starting_prior
from logs.run import Run
from logs.truth import TruthTrack, evaluation_instants

POSE, CALIBRATION = slice(0, 3), slice(3, 6)
"""Of the state: x, y, heading; relative error of distance, of turn, bias of the turn rate. Radio errors follow."""


class Limit(NamedTuple):
    """The bound over a run: instants [ns], and the least root mean square position error there [m]; both (n,)."""

    time_ns: NDArray[np.int64]
    error_m: Floats


def posterior_bound(run: Run) -> Limit:
    """The bound of every filter at the instants at which estimators are scored (`evaluation_instants`).

    Readings count from their own time on, however late they came. NaN before the prior, and from the first motion on
    whose true heading is not known: all NaN for a truth that has none. Raises `LogError` without truth.
    """
    if run.truth is None or not np.isfinite(run.truth.x + run.truth.y).any():
        raise LogError(f"{run.path}: holds no ground truth, and the bound is taken there; give a run with truth")
    time_ns, prior = evaluation_instants(run.truth).time_ns, starting_prior(run)
    tracker = Tracker(AtTruth(run.world, run.truth), run.world, prior)
    waiting = sorted(run.measurements, key=order, reverse=True)
    error_m = np.full(len(time_ns), np.nan)
    for k, now_ns in enumerate(time_ns.tolist()):
        while waiting and waiting[-1].time_ns <= now_ns:
            tracker.push(waiting.pop())
        covariance = tracker.estimate(now_ns).covariance
        if covariance is not None and now_ns >= prior.time_ns:
            error_m[k] = math.sqrt(covariance.xx + covariance.yy)
    return Limit(time_ns, error_m)


def eff_pcrlb(error_m: Floats, bound_m: Floats) -> float:
    """Ratio of a filter's error to the limit: the mean over time of RMSE over seeds / bound; (seeds, n) [m] each.

    The bound of an instant is the root mean square over seeds. Answers that are not valid (infinite) are left out,
    and so are instants without any, or without a bound above zero: read it beside the availability. NaN where nothing
    is left. With one seed an efficient filter reads about 0.89, not 1: the mean of a Rayleigh variable over its root
    mean square. Well below 1, a prior better than claimed, tuning on the test data, noise less than the world
    states, or a fault is at work.
    """
    valid = np.isfinite(error_m)
    counts = valid.sum(axis=0)
    bound_square = np.mean(bound_m**2, axis=0)
    counted = (counts > 0) & np.isfinite(bound_square) & (bound_square > 0.0)
    if not counted.any():
        return math.nan
    mean_square = np.where(valid, error_m, 0.0)[:, counted] ** 2
    return float(np.mean(np.sqrt(mean_square.sum(axis=0) / counts[counted] / bound_square[counted])))


class State(NamedTuple):
    """The bound's covariance at ``time_ns``."""

    time_ns: int
    covariance: Floats


class AtTruth:
    """The recursion, behind the estimator's contract; its pose is the truth."""

    summary: ClassVar[str] = "posterior Cramer-Rao bound, linearised at the truth"
    tags: ClassVar[frozenset[Tag]] = frozenset()

    def __init__(self, world: World, truth: TruthTrack) -> None:
        self._world = world
        known = np.isfinite(truth.x + truth.y)
        self._start_ns = int(truth.time_ns[known][0])
        self._elapsed_ns = (truth.time_ns[known] - self._start_ns).astype(np.float64)
        self._columns = (truth.x[known], truth.y[known], _unwrapped(truth.heading[known]))
        noise = world.robot.noise
        stds = [noise.distance_scale_std, noise.turn_scale_std, noise.turn_bias_std_rad_s]
        self._gain_index: dict[type, int] = {}
        self._bias_index: dict[tuple[str, type], int] = {}
        for anchor in world.anchors:
            for model in (anchor.radio, anchor.ranging):
                if type(model) not in self._gain_index:
                    self._gain_index[type(model)] = 3 + len(stds)
                    stds.append(model.gain_std)
                self._bias_index[anchor.id, type(model)] = 3 + len(stds)
                stds.append(model.bias_std)
        self._variances = np.square(stds)

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior, taken as Gaussian."""
        size = 3 + len(self._variances)
        covariance = np.zeros((size, size))
        covariance[POSE, POSE] = starting_belief(self._world, prior)[1].matrix
        covariance[range(3, size), range(3, size)] = self._variances
        return State(prior.time_ns, covariance)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Compose the motion, and add the scan's information."""
        time_ns = motion.time_ns if scan is None else scan.time_ns
        covariance, (x, y, heading) = self._moved(state, motion, time_ns), self._pose(time_ns)
        for reading in () if scan is None else radio_readings(self._world, scan):
            expected, kind = reading.expect(x, y, heading, self._world.robot.antenna_m), type(reading.model)
            row = np.zeros(len(covariance))
            row[POSE] = expected.by_x, expected.by_y, expected.by_heading
            row[self._gain_index[kind]] = expected.by_gain
            row[self._bias_index[reading.anchor.id, kind]] = 1.0
            column = covariance @ row
            covariance = covariance - np.outer(column, column / (float(row @ column) + reading.variance))
        return State(time_ns, covariance), ()

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The truth, with the bound as its covariance."""
        p = self._moved(state, motion, time_ns)[POSE, POSE].tolist()
        covariance = Covariance.from_matrix(p)
        return Estimate(time_ns, self._pose(time_ns), covariance)

    def _pose(self, time_ns: int) -> Pose:
        """The truth between its stamps; before and after them the robot stands still."""
        elapsed_ns = float(time_ns - self._start_ns)
        return Pose(*(float(np.interp(elapsed_ns, self._elapsed_ns, column)) for column in self._columns))

    def _moved(self, state: State, motion: Increment, time_ns: int) -> Floats:
        """F P Fᵀ + G Q Gᵀ over the motion up to ``time_ns``: displacement and heading are the truth's."""
        before, after = self._pose(state.time_ns), self._pose(time_ns)
        step = move(before.heading, motion)
        transition = np.eye(len(state.covariance))
        transition[:2, 2] = before.y - after.y, after.x - before.x
        transition[POSE, CALIBRATION] = step.x_by_errors, step.y_by_errors, step.turn_by_errors
        covariance = transition @ state.covariance @ transition.T
        covariance[POSE, POSE] += step.noise.matrix
        return np.asarray(covariance)


def _unwrapped(heading: Floats) -> Floats:
    """Headings (n,) [rad] without jumps by whole turns; NaN stays NaN, and only there."""
    known = np.isfinite(heading)
    continuous = heading.copy()
    continuous[known] = np.unwrap(heading[known])
    return continuous
