"""Extended Kalman filter over the pose, with the calibration errors that spoil long runs as further states.

The state is (x, y, heading), then whichever of these the world gives a standard deviation: the relative error of
distance, the relative error of turn, the bias of the turn rate, and the common error of each anchor's readings. An
anchor's error is a first-order Gauss-Markov process in the path driven (Gudmundson 1991: shadowing stays correlated
over a path), which also covers a constant offset. Motion is composed once per radio epoch from the pre-integrated
increment; readings enter one at a time, all linearised and gated at the belief before the scan, so
their order does not matter (Bar-Shalom, Li & Kirubarajan 2001, section 5.4 and eq. 5.4.2-13 for the gate).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

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
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.correlated_error import correlated_count_of, require_max_correlated
from fusion.fates import chi_square_gate
from fusion.plain_covariance import Row, scaled_gain, shared_with, with_states, without
from fusion.radio import PathLoss, Ranging

POSE = 3
"""States of the pose, which come first; then those of the odometry's calibration."""


class State(NamedTuple):
    """The belief, and the path driven since the last scan; nothing in it is written to. ``anchors``: the anchors and
    kinds of readings whose common errors are its last states, in the order in which they were first received.
    """

    mean: Row
    covariance: list[Row]
    path_m: float
    anchors: tuple[tuple[str, type], ...]


class AnchorError(NamedTuple):
    """Common error of one anchor's readings: its variance, and the path after which it is forgotten [m]."""

    variance: float
    length_m: float


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
        self._variances = [std * std for std in stds]
        self._lengths_m = {PathLoss: rssi_bias_length_m, Ranging: range_bias_length_m}
        self._anchor_errors: dict[tuple[str, type], AnchorError] = {}
        wanted = {PathLoss: estimate_rssi_bias, Ranging: estimate_range_bias}
        for anchor_id, model in models:
            known_m, asked = model.bias_length_m, wanted[type(model)]
            if model.bias_std > 0.0 and (known_m is not None if asked is None else asked):
                length_m = known_m or self._lengths_m[type(model)]
                self._anchor_errors[anchor_id, type(model)] = AnchorError(model.bias_std**2, length_m)

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior, with every calibration error at zero."""
        pose, covariance = starting_belief(self._world, prior)
        mean, rows = with_states(list(pose), [list(row) for row in covariance.matrix], self._variances)
        return State(mean, rows, 0.0, ())

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Compose the motion; update by the readings."""
        moved = self._moved(state, motion)
        return (moved, ()) if scan is None else self._updated(moved, scan)

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The pose after the motion since; nothing but pose and calibration moves it."""
        x, y, heading, *_ = state.mean
        if motion.duration_s == 0.0:
            (xx, xy, xh, *_), (_, yy, yh, *_), (_, _, hh, *_), *_ = state.covariance
            covariance = Covariance(xx, xy, xh, yy, yh, hh)
        else:
            step = self._move(state.mean, motion)
            covariance = self._corner(step, state.covariance)
            x, y, heading = x + step.dx, y + step.dy, wrap_angle(heading + step.turn)
        known = covariance.hh < HEADING_KNOWN_STD**2
        return Estimate(time_ns, Pose(x, y, heading), covariance, True, known)

    def _move(self, mean: Row, motion: Increment) -> Move:
        return move(mean[2], motion, *mean[POSE : 2 * POSE]) if self._calibrated else move(mean[2], motion)

    def _corner(self, step: Move, rows: Sequence[Row]) -> Covariance:
        """F P Fᵀ + Q for the pose, of which F has the Jacobian by pose and odometry's errors: (3, 6), or (3, 3)."""
        dx, dy, noise = step.dx, step.dy, step.noise
        if not self._calibrated:
            xx, xy, xh = rows[0][:POSE]
            yy, yh, hh = rows[1][1], rows[1][2], rows[2][2]
            x_h, y_h = xh - dy * hh, yh + dx * hh
            return Covariance(
                xx - dy * (xh + x_h) + noise.xx,
                xy + dx * xh - dy * y_h + noise.xy,
                x_h + noise.xh,
                yy + dx * (yh + y_h) + noise.yy,
                y_h + noise.yh,
                hh + noise.hh,
            )
        (a, b, c), (d, e, f), (_, g, k) = step.x_by_errors, step.y_by_errors, step.turn_by_errors
        # The errors: s of distance, t of turn, r of the rate; x_h is the covariance of the new x with the old heading.
        xx, xy, xh, xs, xt, xr = rows[0][:6]
        _, yy, yh, ys, yt, yr = rows[1][:6]
        hh, hs, ht, hr = rows[2][2:6]
        ss, st, sr = rows[3][3:6]
        tt, tr, rr = rows[4][4], rows[4][5], rows[5][5]
        x_h = xh - dy * hh + a * hs + b * ht + c * hr
        x_s = xs - dy * hs + a * ss + b * st + c * sr
        x_t = xt - dy * ht + a * st + b * tt + c * tr
        x_r = xr - dy * hr + a * sr + b * tr + c * rr
        y_h = yh + dx * hh + d * hs + e * ht + f * hr
        y_s = ys + dx * hs + d * ss + e * st + f * sr
        y_t = yt + dx * ht + d * st + e * tt + f * tr
        y_r = yr + dx * hr + d * sr + e * tr + f * rr
        h_t, h_r = ht + g * tt + k * tr, hr + g * tr + k * rr
        return Covariance(
            xx - dy * (xh + x_h) + a * (xs + x_s) + b * (xt + x_t) + c * (xr + x_r) + noise.xx,
            xy - dy * yh + a * ys + b * yt + c * yr + dx * x_h + d * x_s + e * x_t + f * x_r + noise.xy,
            x_h + g * x_t + k * x_r + noise.xh,
            yy + dx * (yh + y_h) + d * (ys + y_s) + e * (yt + y_t) + f * (yr + y_r) + noise.yy,
            y_h + g * y_t + k * y_r + noise.yh,
            hh + g * (ht + h_t) + k * (hr + h_r) + noise.hh,
        )

    def _across(self, step: Move, rows: Sequence[Row]) -> tuple[Row, Row, Row]:
        """F P for the pose, with all states but the pose."""
        dx, dy = step.dx, step.dy
        first, second, third = (row[POSE:] for row in rows[:POSE])
        if not self._calibrated:
            return (
                [x - dy * h for x, h in zip(first, third)],
                [y + dx * h for y, h in zip(second, third)],
                third,
            )
        (a, b, c), (d, e, f), (_, g, k) = step.x_by_errors, step.y_by_errors, step.turn_by_errors
        errors = [row[POSE:] for row in rows[POSE : 2 * POSE]]
        return (
            [x - dy * h + a * s + b * t + c * r for x, h, s, t, r in zip(first, third, *errors)],
            [y + dx * h + d * s + e * t + f * r for y, h, s, t, r in zip(second, third, *errors)],
            [h + g * t + k * r for h, t, r in zip(third, *errors[1:])],
        )

    def _moved(self, state: State, motion: Increment) -> State:
        """The state after ``motion``: P <- F P Fᵀ + Q, where F is the identity but for the rows of the pose and the
        fading of the anchors' errors, which are forgotten up to their own variance.
        """
        if motion.duration_s == 0.0:
            return state
        errors = [self._anchor_errors[anchor] for anchor in state.anchors]
        fading = [math.exp(-motion.path_m / error.length_m) for error in errors]
        kept = [1.0] * (len(state.mean) - POSE - len(errors)) + fading
        x, y, heading, *rest = state.mean
        step = self._move(state.mean, motion)
        across = [[p * k for p, k in zip(row, kept)] for row in self._across(step, state.covariance)]
        below = [[p * (own * k) for p, k in zip(row[POSE:], kept)] for own, row in zip(kept, state.covariance[POSE:])]
        for i, (own, error) in enumerate(zip(fading, errors), start=len(kept) - len(errors)):
            below[i][i] += (1.0 - own * own) * error.variance
        corner = self._corner(step, state.covariance).matrix
        rows = [[*own, *row] for own, row in zip(corner, across)]
        rows += [[*column, *row] for column, row in zip(zip(*across), below)]
        mean = [x + step.dx, y + step.dy, wrap_angle(heading + step.turn), *(m * k for m, k in zip(rest, kept))]
        return State(mean, rows, state.path_m + motion.path_m, state.anchors)

    def _updated(self, before: State, scan: Radio) -> tuple[State, tuple[Fate, ...]]:
        readings = radio_readings(self._world, scan)
        before = self._with_anchors(before, readings)
        places = {anchor: i for i, anchor in enumerate(before.anchors, start=len(before.mean) - len(before.anchors))}
        mean, gains, fates = before.mean, list[Row](), []
        for reading in readings:
            innovation, jacobian, variance = self._linearise(reading, before, places)
            shared = shared_with(before.covariance, jacobian)
            spread = variance + sum(by * shared[i] for i, by in jacobian.items())
            nis = innovation * innovation / spread
            used = nis <= self._gate
            if used:
                remaining = innovation - sum(by * (mean[i] - before.mean[i]) for i, by in jacobian.items())
                gain, step = scaled_gain(shared, jacobian, gains, variance, remaining)
                gains.append(gain)
                mean = [m + step * g for m, g in zip(mean, gain)]
            verdict = (Decision.USED, Reason.OK, 1.0) if used else (Decision.REJECTED, Reason.GATE, 0.0)
            who = (scan.time_ns, scan.sensor, scan.seq, reading.anchor.id)
            fates.append(Fate(*who, *verdict, innovation, spread, nis))
        x, y, heading, *rest = mean
        rows = without(before.covariance, gains)
        return State([x, y, wrap_angle(heading), *rest], rows, 0.0, before.anchors), tuple(fates)

    def _with_anchors(self, state: State, readings: Sequence[RadioReading]) -> State:
        """The state, with the common errors of anchors that it has received nothing of before."""
        received = [(reading.anchor.id, type(reading.model)) for reading in readings]
        new = tuple(one for one in received if one in self._anchor_errors and one not in state.anchors)
        if not new:
            return state
        mean, rows = with_states(state.mean, state.covariance, [self._anchor_errors[one].variance for one in new])
        return State(mean, rows, state.path_m, state.anchors + new)

    def _linearise(
        self, reading: RadioReading, state: State, places: dict[tuple[str, type], int]
    ) -> tuple[float, dict[int, float], float]:
        """Innovation, Jacobian (by the states that are in it) and variance of one reading at the belief before it."""
        x, y, heading, *_ = state.mean
        expected = reading.expect(x, y, heading, self._world.robot.antenna_m)
        jacobian = {0: expected.by_x, 1: expected.by_y}
        if expected.by_heading != 0.0:
            jacobian[2] = expected.by_heading
        innovation, variance, kind = reading.value - expected.value, reading.variance, type(reading.model)
        if (gain := self._gain_index.get(kind)) is not None:
            jacobian[gain] = expected.by_gain
            innovation -= expected.by_gain * state.mean[gain]
        if (place := places.get((reading.anchor.id, kind))) is None:
            times = correlated_count_of(reading.model, state.path_m, self._max_correlated, self._lengths_m[kind])
            return innovation, jacobian, variance + times * reading.model.bias_std**2
        jacobian[place] = 1.0
        return innovation - state.mean[place], jacobian, variance
