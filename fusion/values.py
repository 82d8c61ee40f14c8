"""The values that flow through the house: measurements in, estimates and fates out.

All are small and immutable, in SI units and radians, with time in integer nanoseconds. ``time_ns`` is when a
measurement was true. ``sensor`` and ``seq`` identify it: the pair is unique within a run at one ``time_ns``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, unique
from numbers import Real
from typing import NamedTuple, TypeAlias

from fusion.errors import BeliefError
from fusion.geometry import Covariance, Pose

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""


def seconds(duration_ns: int) -> float:
    """A duration in nanoseconds, in seconds."""
    return duration_ns / NANOSECONDS


def nanoseconds(duration_s: float) -> int:
    """A duration in seconds, in whole nanoseconds."""
    return round(duration_s * NANOSECONDS)


@dataclass(frozen=True, slots=True)
class WheelTicks:
    """Cumulative encoder counts, one per wheel in the order of ``World.robot``: a lost message loses no distance."""

    time_ns: int
    sensor: str
    seq: int
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class MotorCommand:
    """Commanded speed of each wheel, signed [m/s]. Gives single-channel encoders their sign."""

    time_ns: int
    sensor: str
    seq: int
    wheel_speeds_m_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Odometry:
    """An increment of motion over (``from_ns``, ``time_ns``]: path length driven forward [m] and turn [rad], left
    positive. ``measured`` False: nothing measured the motion of that time, and zero stands for "not known".
    """

    time_ns: int
    sensor: str
    seq: int
    from_ns: int
    distance_m: float
    turn_rad: float
    measured: bool = True


@dataclass(frozen=True, slots=True)
class Gyro:
    """Turn rate about the vertical [rad/s], left positive, raw: the bias is not taken off.

    ``acceleration_m_s2`` is that of the same chip along its own axes, None where it has none.
    """

    time_ns: int
    sensor: str
    seq: int
    rate_rad_s: float
    acceleration_m_s2: tuple[float, float, float] | None = None


class RssiReading(NamedTuple):
    """One anchor's signal strength [dBm], ``age_ns`` before the scan's own time."""

    anchor: str
    rssi_dbm: float
    age_ns: int = 0

    @property
    def value(self) -> float:
        """The number that was measured [dBm]."""
        return self.rssi_dbm


@dataclass(frozen=True, slots=True)
class WifiScan:
    """Signal strengths received in one scan (Wi-Fi or BLE)."""

    time_ns: int
    sensor: str
    seq: int
    readings: tuple[RssiReading, ...]


class RangeReading(NamedTuple):
    """One anchor's measured distance [m]; ``std_m`` as the device claims it, None where it claims nothing."""

    anchor: str
    range_m: float
    std_m: float | None = None

    @property
    def value(self) -> float:
        """The number that was measured [m]."""
        return self.range_m


@dataclass(frozen=True, slots=True)
class Ranges:
    """Distances measured at one time (UWB or Wi-Fi round-trip time)."""

    time_ns: int
    sensor: str
    seq: int
    readings: tuple[RangeReading, ...]


Motion: TypeAlias = WheelTicks | MotorCommand | Odometry | Gyro
Radio: TypeAlias = WifiScan | Ranges
Measurement: TypeAlias = WheelTicks | MotorCommand | Odometry | Gyro | WifiScan | Ranges


class Truth(NamedTuple):
    """True pose of the robot: a stream of its own that no estimator ever sees.

    A heading that is None or not finite is not known, nor is a position of which a coordinate is not finite.
    """

    time_ns: int
    x: float
    y: float
    heading: float | None = None

    @property
    def position_known(self) -> bool:
        """Whether it has a position."""
        return math.isfinite(self.x) and math.isfinite(self.y)

    @property
    def known_heading(self) -> float | None:
        """The heading [rad], None where it is not known."""
        return None if self.heading is None or not math.isfinite(self.heading) else self.heading


@dataclass(frozen=True, slots=True)
class Prior:
    """Knowledge before the first measurement. What is not known counts as uniform, whatever its numbers: they may
    be NaN. Raises `BeliefError` where the others are not finite, or no covariance.
    """

    time_ns: int
    pose: Pose
    covariance: Covariance
    position_known: bool = True
    heading_known: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.covariance, Covariance):
            raise BeliefError(f"prior: {self.covariance!r} is no fusion.Covariance; Covariance.from_matrix makes one")
        known = (self.position_known, self.position_known, self.heading_known)
        for name, number, is_known in zip(Pose._fields, self.pose, known, strict=True):
            if is_known and not (isinstance(number, Real) and math.isfinite(number)):
                remedy = "heading_known=False" if name == "heading" else "position_known=False"
                raise BeliefError(f"prior: {name} is {number}, no finite number; give {remedy} where it is not known")
        if flaw := self.covariance.flaw(known):
            raise BeliefError(f"prior: {flaw}; give a finite, symmetric and positive semi-definite covariance")


class Estimate(NamedTuple):
    """Pose of the robot by an estimator.

    ``covariance`` is None where the method claims none. ``valid`` False means "do not use this pose".
    ``p_lost`` is the estimator's own probability that it is lost, None without an opinion. ``reset_count`` rises
    by one whenever belief is replaced instead of corrected; ``reset_delta`` is the last such jump (dx, dy, dheading).
    """

    time_ns: int
    pose: Pose
    covariance: Covariance | None
    valid: bool = True
    heading_known: bool = True
    p_lost: float | None = None
    reset_count: int = 0
    reset_delta: Pose | None = None


@unique
class Decision(Enum):
    """Decision on a reading."""

    USED = "used"
    DOWNWEIGHTED = "downweighted"
    REJECTED = "rejected"
    LATE = "late"
    UNUSABLE = "unusable"


@unique
class Reason(Enum):
    """Reason of a decision; a closed list. The host writes those of the second group."""

    OK = "ok"
    ROBUST_LOSS = "robust_loss"
    NLOS_MODE = "nlos_mode"
    GATE = "gate"
    OUTLIER = "outlier"
    TOO_FEW_ANCHORS = "too_few_anchors"
    COLLINEAR_ANCHORS = "collinear_anchors"
    KIND_NOT_CONSUMED = "kind_not_consumed"

    UNKNOWN_ANCHOR = "unknown_anchor"
    NOT_FINITE = "not_finite"
    OUT_OF_RANGE = "out_of_range"
    STALE = "stale"
    TOO_LATE = "too_late"
    DUPLICATE = "duplicate"
    BAD_CLOCK = "bad_clock"
    EXCLUDED_BY_REQUEST = "excluded_by_request"


class Fate(NamedTuple):
    """Decision on one reading: one per anchor in a scan, one for every other measurement that is not plain motion.

    ``anchor`` is "" for a measurement without anchors. ``weight`` in [0, 1] is the share of the reading's nominal
    information that entered the state. ``innovation`` is measurement minus prediction from the belief *before* the
    whole scan, in the reading's own unit; ``innovation_variance`` its variance; ``nis`` their normalised square, also
    for refused readings. All three are None where the method has no such prediction.
    """

    time_ns: int
    sensor: str
    seq: int
    anchor: str
    decision: Decision
    reason: Reason
    weight: float
    innovation: float | None = None
    innovation_variance: float | None = None
    nis: float | None = None
