"""The contract every estimator keeps: three pure functions over an immutable state.

A plug-in is a class built as ``Class(world, **parameters)`` whose object never changes afterwards. Everything that
changes is in the state, which the host never looks inside: it keeps it, pickles it, goes back to an older one. The
same arguments always give the same answer, to the last bit. There is no clock, file, thread or global random
generator in an estimator; randomness comes from `generator`. `docs/plugin.md` builds one step by step.
"""

from __future__ import annotations

from enum import Enum, unique
from typing import ClassVar, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from fusion.values import Estimate, Fate, Measurement, Prior

State = TypeVar("State")
State_contra = TypeVar("State_contra", contravariant=True)


@unique
class Tag(Enum):
    """What a method is, as far as the host and the conformance kit must know."""

    STOCHASTIC = "stochastic"
    """Draws random numbers: another seed gives another answer."""
    GLOBAL_START = "global_start"
    """Can start from an unknown position."""
    HEADING_START = "heading_start"
    """Can start from an unknown heading."""
    NO_COVARIANCE = "no_covariance"
    """Claims no covariance: its estimates carry None."""
    NO_HEADING = "no_heading"
    """Estimates a position only."""
    NO_RADIO = "no_radio"
    """Uses motion alone."""
    NOT_ROBUST = "not_robust"
    """Believes every reading: one outlier of any size may move it by any amount."""


@runtime_checkable
class Estimator(Protocol[State]):
    """What the host calls. The measurements handed to ``step`` are in order, finite, of known anchors; motion comes
    as `Odometry` that reaches up to each radio measurement.
    """

    summary: ClassVar[str]
    """One line: what it does, for lists."""
    tags: ClassVar[frozenset[Tag]]

    def start(self, prior: Prior, seed: int) -> State:
        """The state before the first measurement."""

    def step(self, state: State, measurement: Measurement) -> tuple[State, tuple[Fate, ...]]:
        """The state after ``measurement``, and what became of its readings. Never raises on a finite reading."""

    def estimate(self, state: State, time_ns: int) -> Estimate:
        """The belief at ``time_ns``, not before the state's own time. Later is never more certain."""


class Particles(NamedTuple):
    """A belief as weighted points: ``positions`` (n, 2) [m], map frame, and ``weights`` (n,), which sum to one."""

    positions: NDArray[np.float64]
    weights: NDArray[np.float64]

    @property
    def effective_number(self) -> float:
        """How many of them count, 1 / Σ weight² (Kong, Liu & Wong 1994): from 1 to n."""
        return 1.0 / float(self.weights @ self.weights)


@runtime_checkable
class ParticleEstimator(Protocol[State_contra]):
    """What an estimator may offer beside the contract when its belief is made of points, so that they can be looked
    at. Nothing depends on it.
    """

    def particles(self, state: State_contra) -> Particles:
        """The points of ``state``, where they are at its own time."""


def generator(seed: int, measurement: Measurement, purpose: int = 0) -> np.random.Generator:
    """Random numbers for one measurement: the same whatever else was or was not processed.

    ``purpose`` keeps two draws at one measurement apart.
    """
    name = int.from_bytes(measurement.sensor.encode()[:16], "little")
    key = (abs(measurement.time_ns), name, abs(measurement.seq), purpose)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
