"""Extended Kalman filter over the pose, with the calibration errors that spoil long runs as further states.

The state is (x, y, heading), then whichever of these the world gives a standard deviation: the relative error of
distance, the relative error of turn, the bias of the turn rate, and the common error of each anchor's readings. An
anchor's error is a first-order Gauss-Markov process in the path driven (Gudmundson 1991: shadowing stays correlated
over a path), which also covers a constant offset. Motion is composed once per radio epoch from the pre-integrated
increment; readings enter one at a time, all linearised and gated at the belief before the scan, so
their order does not matter (Bar-Shalom, Li & Kirubarajan 2001, section 5.4 and eq. 5.4.2-13 for the gate).
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np

from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Increment,
    Move,
    ParameterError,
    Pose,
    Prior,
    Radio,
    RadioReading,
    Reason,
    Tag,
    World,
    move,
    radio_readings,
    wrap_angle,
)
from fusion.arrays import Floats
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.correlated_error import correlated_count_of, require_max_correlated
from fusion.fates import chi_square_gate
from fusion.radio import PathLoss, Ranging

POSE, CALIBRATION = slice(0, 3), slice(3, 6)
HEADING = 2


class State(NamedTuple):
    """The belief, and the path driven since the last scan; arrays are never written to."""

    mean: Floats
    covariance: Floats
    path_m: float


class Ekf:
    """Extended Kalman filter.

    Parameters
    ----------
    gate_probability
        A reading is refused when its normalised innovation squared is beyond this quantile of chi-square with one
        degree of freedom. 1.0 takes every reading.
    estimate_odometry
        Whether distance scale, turn scale and turn-rate bias are states.
    estimate_range_bias, estimate_rssi_bias
        Whether each anchor's common error is a state. Off, its variance is added to that of every reading. A range
        offset belongs to the radio and is well worth a state. Shadowing belongs to the place, and where it is only
        guessed over what path, such states explain away the readings that would correct the heading. None: where the
        world states its `shadowing_length_m`.
    rssi_bias_length_m, range_bias_length_m
        Path after which an anchor's common error is forgotten by 1/e [m], where the world states none: shadowing
        belongs to the place, a range offset to the radio.
    max_correlated
        How many neighbouring readings of an anchor at most are taken to share one error, where that is not a state. 1
        takes all as independent; more is more honest where shadowing is strong, and slower to correct odometry. None:
        20 where the world states its `shadowing_length_m`, else 3.
    """

    summary: ClassVar[str] = "extended Kalman filter with odometry calibration and anchor biases as states"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.HEADING_START})

    def __init__(
        self,
        world: World,
        *,
        gate_probability: float = 0.999,
        estimate_odometry: bool = True,
        estimate_range_bias: bool = True,
        estimate_rssi_bias: bool | None = None,
        rssi_bias_length_m: float = 2.0,
        range_bias_length_m: float = 100.0,
        max_correlated: float | None = None,
    ) -> None:
        if not 0.0 < gate_probability <= 1.0:
            raise ParameterError(f"ekf: gate_probability is {gate_probability}; give a probability in (0, 1]")
        for length_m in (rssi_bias_length_m, range_bias_length_m):
            if length_m <= 0.0:
                raise ParameterError(f"ekf: a bias length is {length_m}; give a length greater than zero")
        self._world = world
        self._gate = chi_square_gate(gate_probability)
        self._max_correlated = require_max_correlated("ekf", max_correlated)
        noise = world.robot.noise
        calibration = (noise.distance_scale_std, noise.turn_scale_std, noise.turn_bias_std_rad_s)
        self._calibrated = estimate_odometry and any(calibration)
        stds = list(calibration) if self._calibrated else []
        models = [(anchor.id, model) for anchor in world.anchors for model in (anchor.radio, anchor.ranging)]
        self._gain_index: dict[type, int] = {}
        for _, model in models:
            if model.gain_std > 0.0 and type(model) not in self._gain_index:
                self._gain_index[type(model)] = 3 + len(stds)
                stds.append(model.gain_std)
        self._first_bias = 3 + len(stds)
        self._bias_index: dict[tuple[str, type], int] = {}
        self._lengths_m = {PathLoss: rssi_bias_length_m, Ranging: range_bias_length_m}
        kept_m = []
        wanted = {PathLoss: estimate_rssi_bias, Ranging: estimate_range_bias}
        for anchor_id, model in models:
            known_m, asked = model.bias_length_m, wanted[type(model)]
            if model.bias_std > 0.0 and (known_m is not None if asked is None else asked):
                self._bias_index[anchor_id, type(model)] = 3 + len(stds)
                stds.append(model.bias_std)
                kept_m.append(known_m or self._lengths_m[type(model)])
        self._extra_variance = np.square(np.array(stds))
        self._bias_length_m = np.array(kept_m)

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior, with every calibration error at zero."""
        pose, pose_covariance = starting_belief(self._world, prior)
        size = 3 + len(self._extra_variance)
        mean, covariance = np.zeros(size), np.zeros((size, size))
        mean[POSE] = pose
        covariance[POSE, POSE] = pose_covariance.matrix
        covariance[range(3, size), range(3, size)] = self._extra_variance
        return State(mean, covariance, 0.0)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Compose the motion; update by the readings."""
        mean, covariance = self._moved(state, motion)
        path_m = state.path_m + motion.path_m
        if scan is None:
            return _state(mean, covariance, path_m), ()
        return self._updated(mean, covariance, path_m, scan)

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The pose after the motion since; nothing but pose and calibration moves it."""
        mean, spread = state.mean[POSE].tolist(), state.covariance[POSE, POSE]
        if motion.duration_s > 0.0:
            step, rows = self._move(state.mean, motion)
            size = rows.shape[1]
            mean = [mean[0] + step.dx, mean[1] + step.dy, mean[2] + step.turn]
            spread = rows @ state.covariance[:size, :size] @ rows.T + step.noise.matrix
        covariance = Covariance.from_matrix(spread.tolist())
        pose = Pose(mean[0], mean[1], wrap_angle(mean[2]))
        return Estimate(time_ns, pose, covariance, heading_known=covariance.hh < HEADING_KNOWN_STD**2)

    def _move(self, mean: Floats, motion: Increment) -> tuple[Move, Floats]:
        """The move of the pose, and its Jacobian by the leading block of the state (pose, calibration): (3, 3 or 6)."""
        errors = mean[CALIBRATION].tolist() if self._calibrated else (0.0, 0.0, 0.0)
        step = move(float(mean[HEADING]), motion, *errors)
        rows = (
            (1.0, 0.0, -step.dy, *step.x_by_errors),
            (0.0, 1.0, step.dx, *step.y_by_errors),
            (0.0, 0.0, 1.0, *step.turn_by_errors),
        )
        return step, np.array(rows)[:, : 6 if self._calibrated else 3]

    def _moved(self, state: State, motion: Increment) -> tuple[Floats, Floats]:
        """Mean and covariance after ``motion``: P <- F P Fᵀ + Q, where F is the identity but for the rows of the pose
        and the fading of the anchors' errors.
        """
        if motion.duration_s == 0.0:
            return state.mean, state.covariance
        step, rows = self._move(state.mean, motion)
        mean, covariance = state.mean.copy(), state.covariance.copy()
        mean[POSE] += (step.dx, step.dy, step.turn)
        top = rows @ covariance[: rows.shape[1]]
        covariance[POSE], covariance[:, POSE] = top, top.T
        covariance[POSE, POSE] = top[:, : rows.shape[1]] @ rows.T + step.noise.matrix
        kept = np.exp(-motion.path_m / self._bias_length_m)
        first, biases = self._first_bias, range(self._first_bias, len(mean))
        mean[first:] *= kept
        covariance[first:] *= kept[:, None]
        covariance[:, first:] *= kept
        covariance[biases, biases] += (1.0 - kept * kept) * self._extra_variance[first - 3 :]
        return mean, covariance

    def _updated(
        self, prior_mean: Floats, prior_covariance: Floats, path_m: float, scan: Radio
    ) -> tuple[State, tuple[Fate, ...]]:
        mean, covariance = prior_mean.copy(), prior_covariance
        fates = []
        for reading in radio_readings(self._world, scan):
            innovation, row, variance = self._linearise(reading, prior_mean, path_m)
            spread = float(row @ prior_covariance @ row) + variance
            nis = innovation * innovation / spread
            used = nis <= self._gate
            if used:
                gain_numerator = covariance @ row
                total = float(row @ gain_numerator) + variance
                remaining = innovation - float(row @ (mean - prior_mean))
                mean = mean + gain_numerator * (remaining / total)
                covariance = covariance - np.outer(gain_numerator, gain_numerator / total)
            verdict = (Decision.USED, Reason.OK, 1.0) if used else (Decision.REJECTED, Reason.GATE, 0.0)
            who = (scan.time_ns, scan.sensor, scan.seq, reading.anchor.id)
            fates.append(Fate(*who, *verdict, innovation, spread, nis))
        return _state(mean, covariance, 0.0), tuple(fates)

    def _linearise(self, reading: RadioReading, mean: Floats, path_m: float) -> tuple[float, Floats, float]:
        """Innovation, Jacobian row and variance of one reading at the belief ``mean``, ``path_m`` after the last."""
        x, y, heading = mean[POSE].tolist()
        expected = reading.expect(x, y, heading, self._world.robot.antenna_m)
        row = np.zeros(len(mean))
        row[POSE] = expected.by_x, expected.by_y, expected.by_heading
        innovation, variance, kind = reading.value - expected.value, reading.variance, type(reading.model)
        if (gain := self._gain_index.get(kind)) is not None:
            row[gain] = expected.by_gain
            innovation -= expected.by_gain * float(mean[gain])
        if (bias := self._bias_index.get((reading.anchor.id, kind))) is None:
            times = correlated_count_of(reading.model, path_m, self._max_correlated, self._lengths_m[kind])
            return innovation, row, variance + times * reading.model.bias_std**2
        row[bias] = 1.0
        return innovation - float(mean[bias]), row, variance


def _state(mean: Floats, covariance: Floats, path_m: float) -> State:
    """The state, its heading wrapped and its covariance symmetric to the last bit."""
    mean[HEADING] = wrap_angle(float(mean[HEADING]))
    return State(mean, 0.5 * (covariance + covariance.T), path_m)
