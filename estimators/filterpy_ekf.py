"""filterpy's extended Kalman filter behind our contract: a baseline everybody knows.

filterpy's object lives for one call: the belief is copied in, predicted or updated, and copied out, so the state stays
a value. Time, gate and Fates are ours; filterpy has none of them. All readings of a scan enter in one update, those
beyond the gate left out, so their order does not matter. `estimators/filterpy_ekf.py` differs only in how a belief is
predicted and compared with readings.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib.util import find_spec
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Increment,
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
from fusion.correlated_error import repeated_variance, require_max_correlated, total_variance
from fusion.fates import chi_square_gate
from fusion.weighted_points import square_root

if find_spec("filterpy") is None:
    # Its import takes a second, and waits until it is used; that it is missing is known at once.
    raise ModuleNotFoundError("No module named 'filterpy'", name="filterpy")

Readings = tuple[RadioReading, ...]


class State(NamedTuple):
    """The belief, and the path driven since the last scan."""

    pose: Pose
    covariance: Covariance
    path_m: float


class FilterpyFilter(ABC):
    """The contract, kept for any Gaussian filter of filterpy; a subclass defines prediction and update."""

    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.HEADING_START})

    def __init__(self, world: World, *, gate_probability: float = 0.999, max_correlated: float | None = None) -> None:
        if not 0.0 < gate_probability <= 1.0:
            raise ParameterError(f"filterpy: gate_probability is {gate_probability}; give a probability in (0, 1]")
        self._world = world
        self._gate = chi_square_gate(gate_probability)
        self._max_correlated = require_max_correlated("filterpy", max_correlated)

    @abstractmethod
    def _predicted(self, state: State, motion: Increment) -> Any:  # noqa: ANN401 - filterpy is not typed
        """The filter of filterpy with the belief of ``state``, after ``motion``."""

    @abstractmethod
    def _expected(self, belief: Any, readings: Readings) -> tuple[Floats, Floats]:  # noqa: ANN401
        """Expected reading and its variance by the ``belief`` alone, of each of ``readings``; both (m,)."""

    @abstractmethod
    def _correct(self, belief: Any, readings: Readings, noise: Floats) -> None:  # noqa: ANN401
        """Bring all ``readings`` into ``belief`` by one update of filterpy; ``noise`` is R (m, m)."""

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior; what is unknown gets the moments of a uniform distribution."""
        return State(*starting_belief(self._world, prior), 0.0)

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Predict; update by the readings."""
        belief, path_m = self._predicted(state, motion), state.path_m + motion.path_m
        if scan is None:
            return State(*copied_out(belief), path_m), ()
        fates = self._update(belief, scan, path_m)
        return State(*copied_out(belief), 0.0), fates

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The pose after the motion since."""
        pose, covariance = state.pose, state.covariance
        if motion.duration_s > 0.0:
            pose, covariance = copied_out(self._predicted(state, motion))
        return Estimate(time_ns, pose, covariance, heading_known=covariance.hh < HEADING_KNOWN_STD**2)

    def _update(self, belief: Any, scan: Radio, path_m: float) -> tuple[Fate, ...]:  # noqa: ANN401
        """Bring the readings of a scan, ``path_m`` after the last, into ``belief``."""
        readings = radio_readings(self._world, scan)
        values, variances = self._expected(belief, readings)
        fates, used = [], []
        for reading, value, variance in zip(readings, values.tolist(), variances.tolist(), strict=True):
            innovation, spread = reading.value - value, variance + total_variance(reading)
            nis = innovation * innovation / spread
            taken = nis <= self._gate
            if taken:
                used.append(reading)
            verdict = (Decision.USED, Reason.OK, 1.0) if taken else (Decision.REJECTED, Reason.GATE, 0.0)
            who = (scan.time_ns, scan.sensor, scan.seq, reading.anchor.id)
            fates.append(Fate(*who, *verdict, innovation, spread, nis))
        if used:
            noise = np.diag([repeated_variance(reading, path_m, self._max_correlated) for reading in used])
            self._correct(belief, tuple(used), noise)
        return tuple(fates)


class FilterpyEkf(FilterpyFilter):
    """The ``ExtendedKalmanFilter`` of filterpy.

    Parameters
    ----------
    gate_probability
        A reading is refused when its normalised innovation squared is beyond this quantile of chi-square with one
        degree of freedom. 1.0 takes every reading.
    max_correlated
        How many neighbouring signal strengths of an anchor at most are taken to share one error, that of the place. 1
        takes all as independent; more is more honest where shadowing is strong, and slower to correct odometry. None:
        20 where the world states its `shadowing_length_m`, else 3.
    """

    summary: ClassVar[str] = "extended Kalman filter of filterpy"

    def _predicted(self, state: State, motion: Increment) -> Any:  # noqa: ANN401
        """The motion's Jacobian A as filterpy's F, and what it leaves of the motion as filterpy's control input."""
        belief = filterpy_kalman().ExtendedKalmanFilter(dim_x=3, dim_z=1)
        belief.x, belief.P = np.array(state.pose), np.array(state.covariance.matrix)
        moved = move(state.pose.heading, motion)
        belief.F = np.array([[1.0, 0.0, -moved.dy], [0.0, 1.0, moved.dx], [0.0, 0.0, 1.0]])
        belief.B, belief.Q = np.eye(3), np.array(moved.noise.matrix)
        belief.predict(u=belief.x + np.array(moved[:3]) - belief.F @ belief.x)
        return belief

    def _expected(self, belief: Any, readings: Readings) -> tuple[Floats, Floats]:  # noqa: ANN401
        values, jacobian = self._linearised(belief.x, readings)
        return values, np.einsum("mi,ij,mj->m", jacobian, belief.P, jacobian)

    def _correct(self, belief: Any, readings: Readings, noise: Floats) -> None:  # noqa: ANN401
        values, jacobian = self._linearised(belief.x, readings)
        seen = np.array([reading.value for reading in readings])
        belief.update(seen, lambda _: jacobian, lambda _: values, R=noise)

    def _linearised(self, x: Floats, readings: Readings) -> tuple[Floats, Floats]:
        """Expected readings (m,) and their Jacobian (m, 3) at the pose ``x``."""
        px, py, heading = x.tolist()
        expected = [reading.expect(px, py, heading, self._world.robot.antenna_m) for reading in readings]
        rows = [(e.by_x, e.by_y, e.by_heading) for e in expected]
        return np.array([e.value for e in expected]), np.array(rows).reshape(-1, 3)


def filterpy_kalman() -> ModuleType:
    """The Kalman filters of filterpy, imported when used."""
    import filterpy.kalman

    module: ModuleType = filterpy.kalman
    return module


def copied_out(belief: Any) -> tuple[Pose, Covariance]:  # noqa: ANN401
    """Pose and covariance of filterpy's filter, the heading wrapped."""
    x, y, heading = np.ravel(belief.x).tolist()
    p = (0.5 * (belief.P + belief.P.T)).tolist()
    return Pose(x, y, wrap_angle(heading)), Covariance.from_matrix(p)


class FilterpyUkf(FilterpyFilter):
    """The ``UnscentedKalmanFilter`` of filterpy.

    Parameters
    ----------
    gate_probability
        A reading is refused when its normalised innovation squared is beyond this quantile of chi-square with one
        degree of freedom. 1.0 takes every reading.
    max_correlated
        How many neighbouring signal strengths of an anchor at most are taken to share one error, that of the place. 1
        takes all as independent; more is more honest where shadowing is strong, and slower to correct odometry. None:
        20 where the world states its `shadowing_length_m`, else 3.
    """

    summary: ClassVar[str] = "unscented Kalman filter of filterpy"

    def _predicted(self, state: State, motion: Increment) -> Any:  # noqa: ANN401 - filterpy is not typed
        kalman = filterpy_kalman()
        points = kalman.MerweScaledSigmaPoints(3, alpha=0.5, beta=2.25, kappa=0.0, sqrt_method=square_root)
        belief = kalman.UnscentedKalmanFilter(
            dim_x=3, dim_z=1, dt=0.0, hx=None, fx=lambda x, _: moved(x, motion), points=points
        )
        belief.x, belief.P = np.array(state.pose), np.array(state.covariance.matrix)
        belief.Q = np.array(move(state.pose.heading, motion).noise.matrix)
        belief.predict()
        return belief

    def _expected(self, belief: Any, readings: Readings) -> tuple[Floats, Floats]:  # noqa: ANN401
        expected = self._expected_at(belief.sigmas_f, readings)
        values = belief.Wm @ expected
        return values, belief.Wc @ np.square(expected - values)

    def _correct(self, belief: Any, readings: Readings, noise: Floats) -> None:  # noqa: ANN401
        seen = np.array([reading.value for reading in readings])
        belief.update(seen, R=noise, hx=lambda x: self._expected_at(x[None, :], readings)[0])

    def _expected_at(self, poses: Floats, readings: Readings) -> Floats:
        """Expected readings (n, m) at ``poses`` (n, 3)."""
        antenna_m = self._world.robot.antenna_m
        x, y, heading = poses.T
        columns = [reading.expected_values(x, y, heading, antenna_m) for reading in readings]
        return np.array(columns).reshape(-1, len(poses)).T


def moved(x: Floats, motion: Increment) -> Floats:
    """The pose ``x`` (3,) after ``motion``; the heading is not wrapped, so that differences of poses stay plain."""
    return np.asarray(x + np.array(move(float(x[2]), motion)[:3]))
