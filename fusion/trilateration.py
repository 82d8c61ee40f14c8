"""A position from distances to known places.

Three anchors: the closed form of Moro & Mehrpouyan 2019 (eqs. 1 and 2), which subtracts the circle equations
1 - 2 and 2 - 3 and solves the two lines that remain. More: least squares on the circles themselves, by Gauss-Newton
from the linear solution. The covariance is that of the method used: distance errors carried through it to first order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fusion.arrays import Floats
from fusion.errors import WorldError

COLLINEAR_RATIO = 1e-3
"""Anchors count as collinear when their spread across the best line is below this share of their spread along it."""


class Fix(NamedTuple):
    """A position [m] with its covariance [m^2] (map frame): no heading, no memory."""

    x: float
    y: float
    xx: float
    xy: float
    yy: float

    @property
    def matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The whole covariance, (2, 2), row by row."""
        return ((self.xx, self.xy), (self.xy, self.yy))


def are_collinear(anchors: Floats) -> bool:
    """Whether the ``anchors`` (n, 2) [m] lie on one line (or point), which leaves two mirror images of every fix."""
    spread = np.linalg.svd(anchors - anchors.mean(axis=0), compute_uv=False)
    return bool(spread[-1] <= COLLINEAR_RATIO * spread[0])


def closed_form(anchors: Floats, distances: Floats) -> tuple[float, float]:
    """The paper's fix (eqs. 1 and 2) from exactly three ``anchors`` (3, 2) [m] and ``distances`` (3,) [m].

    Raises `WorldError` for collinear anchors. (Eq. 2 is printed with both rows of its quotient swapped, which cancels.)
    """
    (xa, ya), (xb, yb), (xc, yc) = anchors.tolist()
    d1, d2, d3 = distances.tolist()
    if are_collinear(anchors):
        raise WorldError(f"anchors at ({xa}, {ya}), ({xb}, {yb}), ({xc}, {yc}) lie on one line: move one off it")
    first = d1**2 - d2**2 - xa**2 + xb**2 - ya**2 + yb**2
    second = d2**2 - d3**2 - xb**2 + xc**2 - yb**2 + yc**2
    determinant = (-2 * yb + 2 * yc) * (-2 * xa + 2 * xb) - (-2 * ya + 2 * yb) * (-2 * xb + 2 * xc)
    x = (first * (-2 * yb + 2 * yc) - second * (-2 * ya + 2 * yb)) / determinant
    y = (second * (-2 * xa + 2 * xb) - first * (-2 * xb + 2 * xc)) / determinant
    return x, y


def linear_least_squares(anchors: Floats, distances: Floats) -> tuple[float, float]:
    """The fix that subtracting the mean circle leaves, in one linear solve; ``anchors`` (n, 2), n >= 3."""
    centred = anchors - anchors.mean(axis=0)
    squares = (anchors**2).sum(axis=1) - distances**2
    solution = np.linalg.lstsq(2.0 * centred, squares - squares.mean(), rcond=None)[0]
    return float(solution[0]), float(solution[1])


def least_squares(anchors: Floats, distances: Floats, stds: Floats, *, iterations: int = 10) -> tuple[float, float]:
    """The fix of least weighted squared distance errors, by damped Gauss-Newton; shapes (n, 2), (n,), (n,)."""
    position = np.array(linear_least_squares(anchors, distances))
    cost = _cost(anchors, distances, stds, position)
    for _ in range(iterations):
        away = position - anchors
        computed = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
        jacobian = away / computed[:, None] / stds[:, None]
        step = np.linalg.lstsq(jacobian, (distances - computed) / stds, rcond=None)[0]
        while (trial := _cost(anchors, distances, stds, position + step)) > cost and np.hypot(*step) > 1e-6:
            step = step / 2.0
        position, cost = position + step, min(cost, trial)
        if np.hypot(*step) < 1e-6:
            break
    return float(position[0]), float(position[1])


def _cost(anchors: Floats, distances: Floats, stds: Floats, position: Floats) -> float:
    computed = np.hypot(*(position - anchors).T)
    return float((((distances - computed) / stds) ** 2).sum())


def trilaterate(anchors: Floats, distances: Floats, stds: Floats) -> Fix:
    """A fix from ``anchors`` (n, 2), ``distances`` (n,) and their ``stds`` (n,), all [m], n >= 3 and not collinear."""
    if len(anchors) == 3:
        x, y = closed_form(anchors, distances)
        covariance = _closed_form_covariance(anchors, distances, stds)
    else:
        x, y = least_squares(anchors, distances, stds)
        covariance = _least_squares_covariance(anchors, np.array([x, y]), stds)
    return Fix(x, y, float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1]))


def _closed_form_covariance(anchors: Floats, distances: Floats, stds: Floats) -> Floats:
    """Distance errors carried through the two lines A p = b(d) of the closed form: A^-1 D R Dᵀ A^-T, D = db/dd."""
    lines = 2.0 * np.diff(anchors, axis=0)
    d1, d2, d3 = (2.0 * distances).tolist()
    by_distance = np.linalg.solve(lines, np.array([[d1, -d2, 0.0], [0.0, d2, -d3]]))
    return np.asarray(by_distance * stds**2 @ by_distance.T)


def _least_squares_covariance(anchors: Floats, position: Floats, stds: Floats) -> Floats:
    """(Hᵀ R^-1 H)^-1 at ``position``, H the unit vectors from the anchors."""
    away = position - anchors
    directions = away / np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)[:, None]
    information = (directions / stds[:, None] ** 2).T @ directions
    return np.asarray(np.linalg.pinv(information, hermitian=True))
