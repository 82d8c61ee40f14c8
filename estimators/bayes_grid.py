"""Histogram Bayes filter: the belief is a probability for every cell of the floor and every heading bin.

No shape is assumed, and nothing is drawn at random (Thrun, Burgard & Fox 2005, sections 4.1 and 8.2; Burgard et al.
1996). Cells are sized so that their number is bounded whatever the floor. Motion shorter than a cell is not applied
but kept, exactly, as the pending increment: readings are compared where each cell would be by now, and once the motion
outgrows a cell or a heading bin the histogram moves as a whole. Fewer moves blur less.
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
    RadioReading,
    Tag,
    World,
    compose,
    radio_readings,
)
from fusion.arrays import Floats
from fusion.belief import HEADING_KNOWN_STD
from fusion.correlated_error import repeated_variance, require_max_correlated
from fusion.fates import judged
from fusion.weighted_points import carried, mixture, moments


class State(NamedTuple):
    """Probability of each (heading bin, x cell, y cell) with its moments, the motion too short to be applied to it, and
    the path driven since the last scan.
    """

    histogram: Floats
    pose: Pose
    covariance: Covariance
    pending: Increment
    path_m: float = 0.0


class BayesGrid:
    """Histogram Bayes filter.

    Parameters
    ----------
    cells
        About how many cells the floor is divided into.
    headings
        How many heading bins a full turn has.
    outlier_share
        Share of readings expected to be outliers, in (0, 1).
    max_correlated
        How many neighbouring signal strengths of an anchor at most are taken to share one error, that of the place. 1
        takes all as independent; more is more honest where shadowing is strong, and slower to correct odometry. None:
        20 where the world states its `shadowing_length_m`, else 3.
    """

    summary: ClassVar[str] = "histogram Bayes filter over floor and heading; starts from anywhere"
    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.GLOBAL_START, Tag.HEADING_START})

    def __init__(
        self,
        world: World,
        *,
        cells: int = 1600,
        headings: int = 24,
        outlier_share: float = 0.05,
        max_correlated: float | None = None,
    ) -> None:
        if cells < 4 or headings < 4:
            raise ParameterError(f"bayes_grid: cells is {cells}, headings {headings}; give at least 4 of each")
        if not 0.0 < outlier_share < 1.0:
            raise ParameterError(f"bayes_grid: outlier_share is {outlier_share}; give a share between 0 and 1")
        self._world = world
        self._outlier_share = outlier_share
        self._max_correlated = require_max_correlated("bayes_grid", max_correlated)
        bounds = world.bounds
        width, depth = bounds.x_max - bounds.x_min, bounds.y_max - bounds.y_min
        self._cell_m = math.sqrt(width * depth / cells)
        self._bin_rad = math.tau / headings
        x = bounds.x_min + self._cell_m * (np.arange(max(2, math.ceil(width / self._cell_m))) + 0.5)
        y = bounds.y_min + self._cell_m * (np.arange(max(2, math.ceil(depth / self._cell_m))) + 0.5)
        # The middle of the bins is heading zero's own, so a robot aligned with the map sits in one bin.
        heading = self._bin_rad * np.arange(headings)
        self._heading, self._x, self._y = np.meshgrid(heading, x, y, indexing="ij", sparse=True)

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior's density in the middle of every cell, smoothed by half a cell; uniform where it is unknown."""
        known = [prior.position_known, prior.position_known, prior.heading_known]
        x, y, heading = prior.pose
        turn = wrapped(self._heading - heading)
        away = np.stack(np.broadcast_arrays(self._x - x, self._y - y, turn), axis=-1)[..., known]
        smoothing = np.diag([self._cell_m, self._cell_m, self._bin_rad]) / 2.0
        spread = (np.array(prior.covariance.matrix) + smoothing @ smoothing)[np.ix_(known, known)]
        exponent = np.einsum("...i,ij,...j->...", away, np.linalg.inv(spread), away)
        return self._state(np.exp(-0.5 * (exponent - exponent.min())), Increment())

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """Apply the motion once it has outgrown a cell, and multiply by the likelihood of the readings."""
        pending, path_m = state.pending.then(motion), state.path_m + motion.path_m
        if scan is None:
            return state._replace(pending=pending, path_m=path_m), ()
        if self._has_outgrown_a_cell(pending):
            state, pending = self._state(self._moved(state.histogram, pending), Increment()), Increment()
        return self._weighed(state._replace(pending=pending, path_m=path_m), scan)

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """Mean and covariance of the histogram, after the motion it has not yet made."""
        pose, covariance = compose(state.pose, state.covariance, state.pending.then(motion))
        return Estimate(time_ns, pose, covariance, heading_known=covariance.hh < HEADING_KNOWN_STD**2)

    def particles(self, state: State) -> Particles:
        """The cells of every heading, carried by the motion not yet made."""
        places = carried(self._x, self._y, self._heading, state.pending)
        every = [np.broadcast_to(place, state.histogram.shape).ravel() for place in places]
        return Particles(np.column_stack(every), state.histogram.ravel())

    def _state(self, histogram: Floats, pending: Increment) -> State:
        """A state of normalised probabilities; within its cell a pose is uniform, hence the twelfths."""
        histogram = histogram / histogram.sum()
        pose, between = moments(histogram, self._x, self._y, self._heading)
        cell, turn = self._cell_m**2 / 12.0, self._bin_rad**2 / 12.0
        spread = between._replace(xx=between.xx + cell, yy=between.yy + cell, hh=between.hh + turn)
        return State(histogram, pose, spread, pending)

    def _weighed(self, state: State, scan: Radio) -> tuple[State, tuple[Fate, ...]]:
        """The state after the readings of a scan."""
        pose, covariance = compose(state.pose, state.covariance, state.pending)
        histogram, fates = state.histogram, []
        for reading in radio_readings(self._world, scan):
            likelihood, good = self._likelihood(reading, state.pending, state.path_m)
            share = min(float(np.sum(state.histogram * good)), 1.0)
            fates.append(judged(scan, reading, pose, covariance, self._world.robot.antenna_m, share))
            histogram = histogram * likelihood
            histogram = histogram / histogram.sum()
        return self._state(histogram, state.pending), tuple(fates)

    def _has_outgrown_a_cell(self, motion: Increment) -> bool:
        spread = motion.covariance
        noise = max(spread.xx, spread.yy) > (0.5 * self._cell_m) ** 2 or spread.hh > (0.5 * self._bin_rad) ** 2
        return noise or math.hypot(motion.x, motion.y) >= self._cell_m or abs(motion.heading) >= self._bin_rad

    def _likelihood(self, reading: RadioReading, motion: Increment, path_m: float) -> tuple[Floats, Floats]:
        """The mixture in every cell, moved by ``motion``, of a reading ``path_m`` after the one before; the reading's
        variance includes its spread within a cell.
        """
        x, y = carried(self._x, self._y, self._heading, motion)
        expected = reading.expected_values(x, y, self._heading + motion.heading, self._world.robot.antenna_m)
        # One heading's floor shows the spread within a cell well enough for all.
        by_x, by_y = np.gradient(expected[0])
        spread = repeated_variance(reading, path_m, self._max_correlated)
        variance = spread + (by_x * by_x + by_y * by_y) / 12.0
        return mixture(reading.value - expected, variance, self._outlier_share)

    def _moved(self, histogram: Floats, motion: Increment) -> Floats:
        """The histogram after ``motion``: each heading's floor is shifted and blurred along x and y, then the heading
        itself. What leaves the floor stays at its edge.
        """
        heading = self._heading[:, 0, 0]
        c, s = np.cos(heading), np.sin(heading)
        cell, variance, noise = self._cell_m, self._cell_m**2, motion.covariance
        dx, dy = (c * motion.x - s * motion.y) / cell, (s * motion.x + c * motion.y) / cell
        xx = (c * c * noise.xx - 2.0 * c * s * noise.xy + s * s * noise.yy) / variance
        yy = (s * s * noise.xx + 2.0 * c * s * noise.xy + c * c * noise.yy) / variance
        along_x, along_y = (
            floor_kernel(dx, xx, histogram.shape[1]),
            floor_kernel(dy, yy, histogram.shape[2]),
        )
        floors = along_x @ histogram @ along_y.transpose(0, 2, 1)
        turned = turn_kernel(motion.heading / self._bin_rad, noise.hh / self._bin_rad**2, len(heading))
        return np.maximum(np.tensordot(turned, floors, axes=1), 0.0)


def wrapped(angle: Floats) -> Floats:
    """Angles [rad] brought into [-pi, pi)."""
    return np.asarray(np.remainder(angle + math.pi, math.tau) - math.pi)


def shift_weights(distance: Floats, mean: Floats | float, variance: Floats | float) -> Floats:
    """Weight of moving by ``distance`` cells when the motion is normal and probability is shared linearly between
    the two nearest cells: the second difference of E[max(u - N, 0)]. Its mean is ``mean`` exactly.
    """
    from scipy.special import ndtr

    std = np.sqrt(np.maximum(variance, 1e-6))

    def ramp(u: Floats) -> Floats:
        density = np.exp(-0.5 * np.square(u / std)) / math.sqrt(math.tau)
        return np.asarray(u * ndtr(u / std) + std * density)

    u = distance - mean
    return np.maximum(ramp(u + 1.0) - 2.0 * ramp(u) + ramp(u - 1.0), 0.0)


def floor_kernel(mean: Floats, variance: Floats, size: int) -> Floats:
    """Matrices (headings, to, from) that move probability along one axis by ``mean`` cells."""
    distance = np.arange(1.0 - size, size)
    weights = shift_weights(distance[None, :], mean[:, None], variance[:, None])
    cells = np.arange(size)
    kernel = weights[:, cells[:, None] - cells[None, :] + size - 1]
    nearest_edge = np.where(cells < size / 2, 0, size - 1)
    kernel[:, nearest_edge, cells] += np.maximum(1.0 - kernel.sum(axis=1), 0.0)
    return kernel


def turn_kernel(mean: float, variance: float, size: int) -> Floats:
    """The circular matrix (to, from) that turns probability by ``mean`` bins."""
    turns = np.arange(size) - mean
    # Three turns either way hold all the probability unless the heading is lost, and then any share is as good.
    laps = sum(shift_weights(np.remainder(turns, size) + lap * size, 0.0, variance) for lap in range(-3, 4))
    weights = np.asarray(laps) / np.sum(laps)
    bins = np.arange(size)
    return np.asarray(weights[(bins[:, None] - bins[None, :]) % size])
