"""The particles of an estimator over a run, watched while it is folded: how many of them count at every radio
measurement, and a few hundred of the clouds, thinned. To keep them all would take more room than the run itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion import Fold, Moment, Particles, Ranges, WifiScan
from fusion.arrays import Floats, Stamps, Whole
from logs.run import Run

MOST_CLOUDS, MOST_POINTS = 300, 500


class Clouds(NamedTuple):
    """``effective_number`` (n,) of particles after the radio measurements at ``time_ns`` (n,). Of some of these, at
    ``cloud_ns`` (k,), the clouds: ``lengths`` (k,) points each, together ``positions`` (m, 2) [m], ``weights`` (m,).
    """

    time_ns: Stamps
    effective_number: Floats
    cloud_ns: Stamps
    lengths: Whole
    positions: Floats
    weights: Floats


class CloudWatch:
    """Looks at the particles of a fold after each radio measurement of one run."""

    def __init__(self, run: Run) -> None:
        radio = sum(isinstance(measurement, WifiScan | Ranges) for measurement in run.measurements)
        self._every = max(math.ceil(radio / MOST_CLOUDS), 1)
        self._seen = 0
        self._effective_number: dict[int, float] = {}
        self._kept: dict[int, Particles] = {}

    def __call__(self, fold: Fold, moment: Moment) -> None:
        """Look, after ``moment`` was folded."""
        scans = [epoch for epoch in moment.epochs if epoch.scan is not None]
        if not scans or (shown := fold.particles()) is None:
            return
        self._effective_number[moment.time_ns] = shown.effective_number
        if self._seen % self._every == 0:
            self._kept[moment.time_ns] = thinned(shown)
        self._seen += 1

    def clouds(self) -> Clouds | None:
        """The clouds; None where there were no particles."""
        if not self._kept:
            return None
        kept = list(self._kept.values())
        return Clouds(
            np.array(list(self._effective_number), dtype=np.int64),
            np.array(list(self._effective_number.values())),
            np.array(list(self._kept), dtype=np.int64),
            np.array([len(cloud.weights) for cloud in kept]),
            np.concatenate([cloud.positions for cloud in kept]),
            np.concatenate([cloud.weights for cloud in kept]),
        )


def thinned(cloud: Particles) -> Particles:
    """At most `MOST_POINTS` particles for a picture: those that systematic resampling would choose, each with the share
    of choices that fell on it.
    """
    if len(cloud.weights) <= MOST_POINTS:
        return cloud
    choices = (np.arange(MOST_POINTS) + 0.5) / MOST_POINTS
    chosen = np.minimum(np.searchsorted(np.cumsum(cloud.weights), choices), len(cloud.weights) - 1)
    rows, counts = np.unique(chosen, return_counts=True)
    return Particles(cloud.positions[rows], counts / MOST_POINTS)
