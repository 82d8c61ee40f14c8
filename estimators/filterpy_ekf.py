"""filterpy's extended Kalman filter behind our contract: a baseline everybody knows.

The filter object of filterpy lives for one call: the belief is copied in, predicted or updated, and copied out, so the
state stays a value. Time, gate and Fates are ours; filterpy has none of them. `estimators/filterpy_ukf.py` differs
only in how a belief is predicted and compared with readings.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from estimators.ekf import chi_square_gate
from estimators.sampling import Array, total_variance
from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    Increment,
    Measurement,
    Odometry,
    ParameterError,
    PluginError,
    Pose,
    Prior,
    Ranges,
    Reason,
    Sighting,
    Tag,
    WifiScan,
    World,
    compose,
    sightings,
    wrap_angle,
)
from fusion.belief import HEADING_KNOWN_STD, starting_belief
from fusion.screen import unusable


class State(NamedTuple):
    """Belief at the last radio epoch and the motion since."""

    time_ns: int
    pose: Pose
    covariance: Covariance
    motion: Increment


class Comparison(NamedTuple):
    """Readings beside the belief before the scan: innovations (m,), their covariance without the readings' own noise
    (m, m), and the readings' variances (m,).
    """

    innovation: Array
    covariance: Array
    variance: Array


class FilterpyFilter(ABC):
    """The contract kept for a Gaussian filter of filterpy, which a subclass names and feeds."""

    tags: ClassVar[frozenset[Tag]] = frozenset({Tag.HEADING_START})

    def __init__(self, world: World, *, gate_probability: float = 0.999) -> None:
        if not 0.0 < gate_probability <= 1.0:
            raise ParameterError(f"filterpy: gate_probability is {gate_probability}; give a probability in (0, 1]")
        try:
            import filterpy.kalman
        except ImportError as error:
            raise PluginError(
                f"filterpy cannot be imported ({error}); pip install fusion-localization[filterpy]"
            ) from error
        self._kalman = filterpy.kalman.__name__
        self._world = world
        self._gate = chi_square_gate(gate_probability)

    @abstractmethod
    def _predicted(self, state: State) -> Any:  # noqa: ANN401 - filterpy is not typed
        """filterpy's filter with the belief of ``state``, moved by the pending motion."""

    @abstractmethod
    def _update(self, belief: Any, readings: tuple[Sighting, ...]) -> None:  # noqa: ANN401
        """Bring all readings into filterpy's filter at once."""

    @abstractmethod
    def _compare(self, belief: Any, readings: tuple[Sighting, ...]) -> Comparison:  # noqa: ANN401
        """The readings beside what the filter expects of them."""

    def start(self, prior: Prior, seed: int) -> State:  # noqa: ARG002 - nothing here is random
        """The prior."""
        return State(prior.time_ns, *starting_belief(self._world, prior), Increment())
