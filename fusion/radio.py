"""Models of radio readings by distance, and their inverses.

Signal strength follows the close-in free-space reference path-loss model (Moro & Mehrpouyan 2019, eqs. 3 and 4;
Rappaport et al. 2015):

    PL(d) = PL(d0) + 10 n log10(d / d0) + X_sigma    for d >= d0        PL(d0) = 20 log10(4 pi d0 / lambda)

Below the reference distance d0 the model is not defined. Here the loss is held at PL(d0), so the expected RSSI is
constant, its slope zero, and the inverse never answers less than d0.

Ranges follow a line: measured = scale * distance + offset. Functions take floats or arrays of any one shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from fusion.arrays import Floats

SPEED_OF_LIGHT_M_S = 299_792_458.0

RadioKind = Literal["rssi", "range"]
"""Signal strengths in dBm, or ranges in metres."""


def free_space_loss_db(distance_m: float, frequency_hz: float) -> float:
    """Free-space path loss 20 log10(4 pi d / lambda) [dB] (eq. 4; Friis 1946)."""
    wavelength_m = SPEED_OF_LIGHT_M_S / frequency_hz
    return 20.0 * math.log10(4.0 * math.pi * distance_m / wavelength_m)


class DistanceModel(Protocol):
    """Dependence of one anchor's reading on the distance between the two antennas."""

    @property
    def std(self) -> float:
        """Standard deviation of one reading, in the reading's unit."""

    @property
    def bias_std(self) -> float:
        """Standard deviation of the error that all readings of one anchor share [the reading's unit]."""

    def expected(self, distance_m: ArrayLike) -> Floats:
        """The reading expected at ``distance_m``."""

    def slope(self, distance_m: ArrayLike) -> Floats:
        """Derivative of ``expected`` [reading's unit / m]."""

    def distance(self, reading: ArrayLike) -> Floats:
        """The distance [m] at which ``reading`` is expected."""

    @property
    def bias_length_m(self) -> float | None:
        """Path after which that common error is forgotten by 1/e [m]; None: not known."""

    @property
    def gain_std(self) -> float:
        """Standard deviation of the error of the gain that all anchors share."""

    def by_gain(self, distance_m: ArrayLike) -> Floats:
        """Derivative of ``expected`` by that common error."""

    def at(self, distance_m: float) -> tuple[float, float, float]:
        """`expected`, `slope` and `by_gain` at one distance, in plain numbers: a filter needs few of them, often."""


@dataclass(frozen=True, slots=True)
class PathLoss:
    """Signal strength of one anchor (eq. 3). ``reference_rssi_dbm`` is the RSSI measured at the reference distance;
    None: computed as transmit power + antenna gains - free-space loss (eq. 4).
    """

    frequency_hz: float = 2.437e9
    path_loss_exponent: float = 2.0
    reference_distance_m: float = 1.0
    transmit_power_dbm: float = 20.0
    transmit_gain_dbi: float = 0.0
    receive_gain_dbi: float = 0.0
    reference_rssi_dbm: float | None = None
    shadowing_std_db: float = 4.0
    bias_std_db: float = 4.0
    shadowing_length_m: float | None = None
    """Over this path shadowing stays correlated, down to 1/e (Gudmundson 1991) [m]; None: not known."""
    exponent_std: float = 0.0

    @property
    def rssi_at_reference_dbm(self) -> float:
        """RSSI expected at the reference distance [dBm]."""
        if self.reference_rssi_dbm is not None:
            return self.reference_rssi_dbm
        gains_dbi = self.transmit_gain_dbi + self.receive_gain_dbi
        return self.transmit_power_dbm + gains_dbi - free_space_loss_db(self.reference_distance_m, self.frequency_hz)

    @property
    def std(self) -> float:
        """Shadowing [dB]."""
        return self.shadowing_std_db

    @property
    def bias_std(self) -> float:
        """Common error of all readings of the anchor [dB]."""
        return self.bias_std_db

    @property
    def bias_length_m(self) -> float | None:
        """It belongs to the place as far as it is shadowing."""
        return self.shadowing_length_m

    def expected(self, distance_m: ArrayLike) -> Floats:
        """RSSI [dBm] expected at ``distance_m``; constant below the reference distance."""
        decades = np.log10(np.maximum(distance_m, self.reference_distance_m) / self.reference_distance_m)
        return np.asarray(self.rssi_at_reference_dbm - 10.0 * self.path_loss_exponent * decades)

    def slope(self, distance_m: ArrayLike) -> Floats:
        """dRSSI/dd [dB/m]: -10 n / (d ln 10), zero below the reference distance."""
        beyond = np.asarray(distance_m) >= self.reference_distance_m
        steepness = -10.0 * self.path_loss_exponent / math.log(10.0)
        return np.where(beyond, steepness / np.maximum(distance_m, self.reference_distance_m), 0.0)

    def distance(self, reading: ArrayLike) -> Floats:
        """Distance [m] from RSSI [dBm], the inverse of eq. 3; never less than the reference distance."""
        exponent = (self.rssi_at_reference_dbm - np.asarray(reading)) / (10.0 * self.path_loss_exponent)
        return np.asarray(self.reference_distance_m * np.power(10.0, np.maximum(exponent, 0.0)))

    @property
    def gain_std(self) -> float:
        """Common error of the path-loss exponent."""
        return self.exponent_std

    def by_gain(self, distance_m: ArrayLike) -> Floats:
        """dRSSI/dn [dB]: -10 log10(d / d0)."""
        ratio = np.maximum(distance_m, self.reference_distance_m) / self.reference_distance_m
        return np.asarray(-10.0 * np.log10(ratio))

    def at(self, distance_m: float) -> tuple[float, float, float]:
        """RSSI [dBm], its slope [dB/m], and dRSSI/dn [dB]."""
        if distance_m < self.reference_distance_m:
            return self.rssi_at_reference_dbm, 0.0, 0.0
        decades = math.log10(distance_m / self.reference_distance_m)
        slope = -10.0 * self.path_loss_exponent / math.log(10.0) / distance_m
        return self.rssi_at_reference_dbm - 10.0 * self.path_loss_exponent * decades, slope, -10.0 * decades


@dataclass(frozen=True, slots=True)
class Ranging:
    """Measured ranges of one anchor: measured = scale * distance + offset + noise."""

    scale: float = 1.0
    offset_m: float = 0.0
    std_m: float = 0.15
    bias_std_m: float = 0.15
    scale_std: float = 0.05

    @property
    def std(self) -> float:
        """Noise [m]."""
        return self.std_m

    @property
    def bias_std(self) -> float:
        """Common error of all ranges of the anchor [m]."""
        return self.bias_std_m

    def expected(self, distance_m: ArrayLike) -> Floats:
        """Range [m] expected at ``distance_m``."""
        return np.asarray(self.scale * np.asarray(distance_m) + self.offset_m)

    def slope(self, distance_m: ArrayLike) -> Floats:
        """The scale, whatever the distance."""
        return np.full_like(distance_m, self.scale, dtype=np.float64)

    def distance(self, reading: ArrayLike) -> Floats:
        """Distance [m] behind a measured range; never less than zero."""
        return np.asarray(np.maximum((np.asarray(reading) - self.offset_m) / self.scale, 0.0))

    @property
    def bias_length_m(self) -> None:
        """None: an offset belongs to the radio, not to a place."""
        return None

    @property
    def gain_std(self) -> float:
        """Common error of the scale."""
        return self.scale_std

    def by_gain(self, distance_m: ArrayLike) -> Floats:
        """The distance itself."""
        return np.asarray(distance_m)

    def at(self, distance_m: float) -> tuple[float, float, float]:
        """Range [m], the scale, and the distance [m]."""
        return self.scale * distance_m + self.offset_m, self.scale, distance_m
