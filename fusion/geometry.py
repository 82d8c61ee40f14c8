"""Poses in the plane: SE(2) in named fields.

Frames read ``target_from_source``: ``map_from_base`` takes a point given in the robot's base frame to the map.
x is forward, y is left, heading is counter-clockwise from the map's x axis (REP-103).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations, combinations_with_replacement
from typing import NamedTuple

from fusion.errors import BeliefError

ROUNDING = 1e-6
"""Share of the standard deviations of two quantities by which rounding may spoil their covariance."""


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
        """From the rows of a (3, 3) of plain numbers; raises `BeliefError` where it is not symmetric but for rounding,
        which the upper half decides.
        """
        if (p[0][1], p[0][2], p[1][2]) != (p[1][0], p[2][0], p[2][1]):
            _require_symmetric(p)
        return cls(p[0][0], p[0][1], p[0][2], p[1][1], p[1][2], p[2][2])

    @property
    def matrix(self) -> tuple[tuple[float, float, float], ...]:
        """The whole matrix, (3, 3), row by row; ``numpy.array(covariance.matrix)`` where arrays are wanted."""
        return (
            (self.xx, self.xy, self.xh),
            (self.xy, self.yy, self.yh),
            (self.xh, self.yh, self.hh),
        )

    def flaw(self, known: tuple[bool, bool, bool] = (True, True, True)) -> str:
        """The reason why this is no covariance of those of (x, y, heading) that are ``known``; "" where it is one.

        A matrix is positive semi-definite when no principal minor is negative. They are those of the correlations
        here, which have no unit, so that one bound on rounding fits all.
        """
        names, p = Pose._fields, self.matrix
        chosen = [axis for axis in range(3) if known[axis]]
        for i, j in combinations_with_replacement(chosen, 2):
            if not math.isfinite(p[i][j]):
                what = f"variance of {names[i]}" if i == j else f"covariance of {names[i]} and {names[j]}"
                return f"the {what} is {p[i][j]}, no finite number"
        for i in chosen:
            if p[i][i] < 0.0:
                return f"the variance of {names[i]} is {p[i][i]:g}, below zero"
        correlations = []
        for i, j in combinations(chosen, 2):
            most = math.sqrt(p[i][i]) * math.sqrt(p[j][j])
            if abs(p[i][j]) > (1.0 + ROUNDING) * most:
                return f"{names[i]} and {names[j]} have a covariance of {p[i][j]:g}, and their variances allow {most:g}"
            correlations.append(p[i][j] / most if most else 0.0)
        if len(correlations) == 3:
            xy, xh, yh = correlations
            if 1.0 + 2.0 * xy * xh * yh - xy * xy - xh * xh - yh * yh < -ROUNDING:
                return f"correlations of {xy:g} (x, y), {xh:g} (x, heading), {yh:g} (y, heading) exclude each other"
        return ""

    @property
    def ellipse(self) -> Ellipse:
        """The ellipse of the position: roots of the eigenvalues of [[xx, xy], [xy, yy]], in closed form.

        >>> Covariance(2.5, 1.5, 0.0, 2.5, 0.0, 0.0).ellipse == (2.0, 1.0, math.pi / 4)
        True
        """
        middle, half = 0.5 * (self.xx + self.yy), math.hypot(0.5 * (self.xx - self.yy), self.xy)
        angle = 0.5 * math.atan2(2.0 * self.xy, self.xx - self.yy)
        return Ellipse(math.sqrt(max(middle + half, 0.0)), math.sqrt(max(middle - half, 0.0)), angle)


def _require_symmetric(p: Sequence[Sequence[float]]) -> None:
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if abs(p[i][j] - p[j][i]) > ROUNDING * math.sqrt(abs(p[i][i] * p[j][j])):
            raise BeliefError(
                f"covariance: row {i + 1}, column {j + 1} is {p[i][j]:g}, and across the diagonal {p[j][i]:g}; "
                "a covariance is symmetric, correct one of them"
            )
