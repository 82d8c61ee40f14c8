"""The implementations that are compared: each takes the blocks of a drive in its own form, and answers a belief."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import fusion
from benchmarks.performance.drive import Drive
from fusion import Covariance, Measurement, Pose, Tracker


class Belief(NamedTuple):
    """A pose (map frame) and its covariance, None where the method claims none."""

    pose: Pose
    covariance: Covariance | None


class Filter(Protocol):
    """A filter at work on a drive."""

    def move(self, steps: Sequence[Any]) -> None:
        """Take in the odometry of a block."""

    def update(self, scan: Any) -> None:  # noqa: ANN401 - in the implementation's own form
        """Take in the ranges at its end."""

    def belief(self) -> Belief:
        """The belief now."""


@dataclass(frozen=True)
class Implementation:
    """A filter of a drive. ``blocks`` brings the drive into its own form, which is not measured."""

    name: str
    start: Callable[[Drive], Filter]
    blocks: Callable[[Drive], Sequence[tuple[Sequence[Any], Any]]]


@dataclass(frozen=True, eq=False)
class Subject:
    """An estimator of ours under the name of its row; ``calibrated``: in a world where only white noise is left."""

    name: str
    estimator: str
    calibrated: bool = False
    options: Mapping[str, object] = field(default_factory=dict)

    def live(self, *, estimates: bool = False) -> Implementation:
        """The estimator behind `fusion.Tracker`; ``estimates``: one is computed after every measurement."""
        kind = EstimatingFilter if estimates else TrackerFilter
        return Implementation(self.name, lambda driven: kind(self.tracker(driven)), lambda driven: driven.blocks)

    def tracker(self, driven: Drive) -> Tracker:
        """A tracker at the start of a drive."""
        built = fusion.build(self.estimator, driven.world, self.options)
        return Tracker(built, driven.world, driven.prior)


EKF, POSE_EKF = Subject("ekf, 10 states", "ekf"), Subject("ekf, 3 states", "ekf", calibrated=True)
PARTICLE = Subject("particle, 1000", "particle", options={"particles": 1000})
DYNAMIC_WEIGHT, DEAD_RECKONING = (Subject(name, name) for name in ("dynamic_weight", "dead_reckoning"))
OF_FILTERPY = tuple(Subject(name, name) for name in ("filterpy_ekf", "filterpy_ukf"))
"""The estimators that need the package filterpy."""


class TrackerFilter:
    """A tracker whose estimate is asked for at the end."""

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker

    def move(self, steps: Sequence[Measurement]) -> None:
        """Push each."""
        push = self._tracker.push
        for step in steps:
            push(step)

    def update(self, scan: Measurement) -> None:
        """Push it."""
        self._tracker.push(scan)

    def belief(self) -> Belief:
        """The estimate at the newest measurement."""
        estimate = self._tracker.estimate(self._tracker.time_ns)
        return Belief(estimate.pose, estimate.covariance)


class EstimatingFilter(TrackerFilter):
    """A tracker whose estimate is asked for after every measurement."""

    def move(self, steps: Sequence[Measurement]) -> None:
        """Push each, and ask."""
        push = self._tracker.push
        for step in steps:
            push(step)[0].estimate  # noqa: B018 - asking computes it

    def update(self, scan: Measurement) -> None:
        """Push it, and ask."""
        self._tracker.push(scan)[0].estimate  # noqa: B018 - asking computes it
