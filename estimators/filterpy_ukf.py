"""filterpy's unscented Kalman filter behind our contract: the same as its extended one, without any derivative.

Sigma points are the scaled ones of van der Merwe (2004). A spread of 1/2 puts them sqrt(3)/2 standard deviations out:
those of an unknown heading then look 90 degrees to either side, where the usual sqrt(3) would make both look backwards,
and no reading could tell them apart. With n = 3 the second parameter 9/4 makes the centre's covariance weight zero, so
no covariance can turn negative. Headings stay unwrapped among the points, so plain means and differences are right.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from estimators.filterpy_ekf import FilterpyFilter, Readings, State, filterpy_kalman
from estimators.sampling import Array, square_root
from fusion import Increment, move


class FilterpyUkf(FilterpyFilter):
    """The ``UnscentedKalmanFilter`` of filterpy.

    Parameters
    ----------
    gate_probability
        A reading is refused when its normalised innovation squared is beyond this quantile of chi-square with one
        degree of freedom. 1.0 takes every reading.
    most_alike
        How many neighbouring signal strengths of an anchor at most are taken to share one error, that of the place. 1
        takes all as independent; more is more honest where shadowing is strong, and slower to correct odometry. None:
        20 where the world tells its `shadowing_length_m`, else 3.
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

    def _expected(self, belief: Any, readings: Readings) -> tuple[Array, Array]:  # noqa: ANN401
        expected = self._expected_at(belief.sigmas_f, readings)
        values = belief.Wm @ expected
        return values, belief.Wc @ np.square(expected - values)

    def _correct(self, belief: Any, readings: Readings, noise: Array) -> None:  # noqa: ANN401
        seen = np.array([sighting.value for sighting in readings])
        belief.update(seen, R=noise, hx=lambda x: self._expected_at(x[None, :], readings)[0])

    def _expected_at(self, poses: Array, readings: Readings) -> Array:
        """Expected readings (n, m) at ``poses`` (n, 3)."""
        antenna_m = self._world.robot.antenna_m
        x, y, heading = poses.T
        columns = [sighting.expected_values(x, y, heading, antenna_m) for sighting in readings]
        return np.array(columns).reshape(-1, len(poses)).T


def moved(x: Array, motion: Increment) -> Array:
    """The pose ``x`` (3,) after ``motion``; the heading is not wrapped, so that differences of poses stay plain."""
    return np.asarray(x + np.array(move(float(x[2]), motion)[:3]))
