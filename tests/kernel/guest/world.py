"""Where the access points stand, where the robot is, and how strongly it hears them."""

from __future__ import annotations

import math
from dataclasses import dataclass

LIGHT_M_PER_S = 299_792_458.0
Point = tuple[float, float]


@dataclass(frozen=True)
class PathLoss:
    """The log-distance law: power falls by 10 n per tenfold distance; metres, dB, dBm."""

    transmit_dbm: float = 20.0
    at_one_metre_db: float = 40.0
    exponent: float = 2.2

    def rssi_dbm(self, distance_m: float) -> int:
        """Received power in whole dBm, as radios say it; nearer than 0.1 m counts as 0.1 m."""
        loss = self.at_one_metre_db + 10.0 * self.exponent * math.log10(max(distance_m, 0.1))
        return round(self.transmit_dbm - loss)


@dataclass
class Air:
    """The world as radio sees it; the only thing that moves is the robot, and an access point may fall silent.

    `access_points` are positions in metres, number 1 first: radio k is access point k, radio 0 is the robot's.
    """

    access_points: tuple[Point, ...] = ((0.0, 0.0), (6.0, 0.0), (3.0, 5.0))
    robot: Point = (1.0, 1.0)
    path_loss: PathLoss = PathLoss()
    faintest_dbm: int = -92
    silent: frozenset[int] = frozenset()

    def distance_m(self, access_point: int) -> float:
        """From the robot to an access point."""
        return math.dist(self.robot, self.access_points[access_point - 1])

    def round_trip_ps(self, access_point: int) -> int:
        """The time of flight there and back."""
        return round(2.0 * self.distance_m(access_point) / LIGHT_M_PER_S * 1e12)

    def rssi_dbm(self, sender: int, receiver: int) -> int | None:
        """What `receiver` hears of `sender`: None for nothing. Access points hear each other at -30 dBm."""
        if sender in self.silent or receiver in self.silent:
            return None
        if sender and receiver:
            return -30
        rssi = self.path_loss.rssi_dbm(self.distance_m(sender or receiver))
        return rssi if rssi >= self.faintest_dbm else None
