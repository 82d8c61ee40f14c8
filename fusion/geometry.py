"""Poses in the plane: SE(2) in named fields.

Frames read ``target_from_source``: ``map_from_base`` takes a point given in the robot's base frame to the map.
x is forward, y is left, heading is counter-clockwise from the map's x axis (REP-103).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


def wrap_angle(angle: float) -> float:
    """``angle`` [rad] brought into (-pi, pi].

    >>> wrap_angle(3 * math.pi) == math.pi
    True
    """
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


class Pose(NamedTuple):
    """Position [m] and heading [rad] of one frame in another."""

    x: float
    y: float
    heading: float

    def compose(self, other: Pose) -> Pose:
        """``a_from_b.compose(b_from_c)`` is ``a_from_c``; the heading is wrapped."""
        x, y = self.transform(other.x, other.y)
        return Pose(x, y, wrap_angle(self.heading + other.heading))

    def inverse(self) -> Pose:
        """``a_from_b.inverse()`` is ``b_from_a``."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, wrap_angle(-self.heading))

    def transform(self, x: float, y: float) -> tuple[float, float]:
        """A point [m] of the source frame, in the target frame."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return self.x + c * x - s * y, self.y + s * x + c * y


class Ellipse(NamedTuple):
    """One standard deviation of a position [m] along the two axes of its ellipse; ``angle`` of the major one [rad]."""

    major_std: float
    minor_std: float
    angle: float


class Covariance(NamedTuple):
    """The six different numbers of a symmetric 3x3 covariance of (x, y, heading), map frame, [m^2, m rad, rad^2]."""

    xx: float
    xy: float
    xh: float
    yy: float
    yh: float
    hh: float

    @classmethod
    def from_std(cls, x_std: float, y_std: float, heading_std: float) -> Covariance:
        """From standard deviations [m, m, rad]: the one place where the two meet."""
        return cls(x_std * x_std, 0.0, 0.0, y_std * y_std, 0.0, heading_std * heading_std)

    @classmethod
    def from_matrix(cls, p: Sequence[Sequence[float]]) -> Covariance:
        """From the rows of a symmetric (3, 3) of plain numbers; what is below the diagonal is not read."""
        return cls(p[0][0], p[0][1], p[0][2], p[1][1], p[1][2], p[2][2])

    @property
    def matrix(self) -> tuple[tuple[float, float, float], ...]:
        """The whole matrix, (3, 3), row by row; ``numpy.array(covariance.matrix)`` where arrays are wanted."""
        return (
            (self.xx, self.xy, self.xh),
            (self.xy, self.yy, self.yh),
            (self.xh, self.yh, self.hh),
        )

    @property
    def ellipse(self) -> Ellipse:
        """The ellipse of the position: roots of the eigenvalues of [[xx, xy], [xy, yy]], in closed form.

        >>> Covariance(2.5, 1.5, 0.0, 2.5, 0.0, 0.0).ellipse == (2.0, 1.0, math.pi / 4)
        True
        """
        middle, half = 0.5 * (self.xx + self.yy), math.hypot(0.5 * (self.xx - self.yy), self.xy)
        angle = 0.5 * math.atan2(2.0 * self.xy, self.xx - self.yy)
        return Ellipse(math.sqrt(max(middle + half, 0.0)), math.sqrt(max(middle - half, 0.0)), angle)
