"""Faults of the measured motion: wheels that slip or count nothing, a gyro that drifts, a robot carried away."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.fault import Fault
from benchmarks.faults.row_selection import Windows
from benchmarks.faults.run_columns import RunColumns
from fusion import ParameterError, Pose, wrap_angle
from fusion.robot import WHEELS
from logs.prior import starting_prior


@dataclass(frozen=True, slots=True)
class Slip(Fault):
    """A wheel counts ``factor`` times as far as it rolled. ``wheel``: one by name, a side (``left``), or
    "" for all; an increment of odometry is taken apart into its wheels and put together again.
    """

    kind: ClassVar[str] = "slip"
    factor: float
    wheel: str = ""
    windows: Windows | None = None

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:  # noqa: ARG002 - no chance in it
        """Scale the roll of the wheels that slip."""
        slipping = columns.messages.select("odom", windows=self.windows)
        columns.roll[np.ix_(np.flatnonzero(slipping), _wheel_indices(self.wheel, columns))] *= self.factor


@dataclass(frozen=True, slots=True)
class Freeze(Fault):
    """A dead encoder: its wheel counts nothing. ``wheel`` as in `Slip`."""

    kind: ClassVar[str] = "freeze"
    wheel: str = ""
    windows: Windows | None = None

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """Slip by nothing at all."""
        Slip(0.0, self.wheel, self.windows).apply(columns, random)


def _wheel_indices(wheel: str, columns: RunColumns) -> NDArray[np.int64]:
    """Columns of the wheels whose names hold all words of ``wheel``."""
    if not wheel:
        return np.arange(columns.roll.shape[1])
    drive = columns.run.world.robot.drive
    matches = [set(wheel.split("_")) <= set(name.split("_")) for name in WHEELS[drive]]
    if not any(matches):
        known = ", ".join(WHEELS[drive]) or "no wheels"
        raise ParameterError(f"the run has no wheel {wheel!r}; its {drive} drive has {known}")
    return np.flatnonzero(matches)


@dataclass(frozen=True, slots=True)
class GyroBias(Fault):
    """A constant is added to the gyro's rate."""

    kind: ClassVar[str] = "gyro_bias"
    bias_deg_s: float
    windows: Windows | None = None

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:  # noqa: ARG002 - no chance in it
        """Shift the rates."""
        columns.rate_rad_s[columns.messages.select("gyro", windows=self.windows)] += math.radians(self.bias_deg_s)


@dataclass(frozen=True, slots=True)
class Kidnap(Fault):
    """The robot is carried off: from ``from_s`` to ``until_s`` wheels and gyro measure no motion (a gyro at rest reads
    the bias that the world states) and radio is silent, while the truth goes on.
    """

    kind: ClassVar[str] = "kidnap"
    from_s: float
    until_s: float

    def __post_init__(self) -> None:
        Fault.__post_init__(self)  # dataclasses with slots are made twice, so super() finds the wrong one
        if self.from_s >= self.until_s:
            raise ParameterError(f"until_s: {self.until_s} must be later than from_s, {self.from_s}")

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:  # noqa: ARG002 - no chance in it
        """Stop the wheels and the gyro, and silence the radio."""
        carried = columns.messages.within(self.lasts)
        columns.roll[carried] = 0.0
        columns.rate_rad_s[carried] = columns.run.world.robot.gyro_bias_rad_s
        columns.messages.kept[carried & np.isin(columns.messages.topic, ("wifi", "ranges"))] = False

    @property
    def lasts(self) -> Windows:
        """From the first to the last moment of it."""
        return ((self.from_s, self.until_s),)


@dataclass(frozen=True, slots=True)
class BadStart(Fault):
    """The pose an estimator starts from is wrong by ``std_m`` along each axis and ``std_deg``; its covariance claims
    what it did.
    """

    kind: ClassVar[str] = "bad_start"
    std_m: float = 0.0
    std_deg: float = 0.0

    def apply(self, columns: RunColumns, random: np.random.Generator) -> None:
        """Three draws: along x, along y, about the vertical."""
        prior = columns.prior or starting_prior(columns.run)
        dx, dy, turn = (random.standard_normal(3) * (self.std_m, self.std_m, math.radians(self.std_deg))).tolist()
        pose = Pose(prior.pose.x + dx, prior.pose.y + dy, wrap_angle(prior.pose.heading + turn))
        columns.prior = replace(prior, pose=pose)
