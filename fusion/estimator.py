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

from fusion.arrays import Floats
from fusion.motion import Increment
from fusion.values import Estimate, Fate, Prior, Radio

State = TypeVar("State")
State_contra = TypeVar("State_contra", contravariant=True)


@unique
class Tag(Enum):
    """Properties of a method that the host and the conformance kit must know."""

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
    """Functions that the host calls, epoch by epoch: a stretch of motion, and the radio scan at its end.

    The host has screened the readings, put them in order and integrated the motion, the same for every estimator; a
    state is the belief at its own moment, the last epoch's, and ``motion`` is always what followed it.
    """

    summary: ClassVar[str]
    """One line: what it does, for lists."""
    tags: ClassVar[frozenset[Tag]]

    def start(self, prior: Prior, seed: int) -> State:
        """The state before the first measurement, at the time of ``prior``."""

    def step(self, state: State, motion: Increment, scan: Radio | None) -> tuple[State, tuple[Fate, ...]]:
        """The state after ``motion`` and then ``scan``, and what became of its readings, one Fate each.

        ``scan`` None: a long stretch of motion without radio is closed, for no calibration derivative of an
        `Increment` holds for ever. Never raises on finite readings.
        """

    def estimate(self, state: State, motion: Increment, time_ns: int) -> Estimate:
        """The belief at ``time_ns``, after the ``motion`` since the state's own moment. Later is never more certain."""


class Particles(NamedTuple):
    """A belief as weighted points: ``positions`` (n, 2) [m], map frame, and ``weights`` (n,), which sum to one."""

    positions: Floats
    weights: Floats

    @property
    def effective_number(self) -> float:
        """Effective number of them, 1 / Σ weight² (Kong, Liu & Wong 1994): from 1 to n."""
        return 1.0 / float(self.weights @ self.weights)


@runtime_checkable
class ParticleEstimator(Protocol[State_contra]):
    """Optional part of the contract for an estimator whose belief is made of points, so that they can be looked
    at. Nothing depends on it.
    """

    def particles(self, state: State_contra) -> Particles:
        """The points of ``state``, at its own moment."""


def generator(seed: int, time_ns: int, sensor: str = "", seq: int = 0, purpose: int = 0) -> np.random.Generator:
    """Random numbers for one epoch, named by its time and the sensor and sequence number of its scan: the same
    whatever else was or was not processed.

    ``purpose`` keeps two draws at one epoch apart.
    """
    name = int.from_bytes(sensor.encode()[:16], "little")
    key = (abs(time_ns), name, abs(seq), purpose)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
