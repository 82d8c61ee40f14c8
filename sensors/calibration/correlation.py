"""Correlation of neighbouring places: exponential over the floor (Gudmundson 1991), estimated by REML."""

from __future__ import annotations

import math

import numpy as np

from fusion.arrays import Floats, Whole
from sensors.calibration.place_medians import PlaceMedians
from sensors.calibration.readings_by_place import extent_m

LENGTHS, SHARES = 10, (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Number of correlation lengths, and shares of uncorrelated variance, that are tried."""


def blocks(medians: PlaceMedians, length_m: float, share: float) -> list[tuple[Whole, Floats]]:
    """Rows of each anchor and the correlation matrix of their residuals; anchors are independent."""
    parts = []
    for anchor in np.unique(medians.anchor):
        rows = np.flatnonzero(medians.anchor == anchor)
        x, y = medians.x[rows], medians.y[rows]
        away = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y))
        parts.append((rows, (1.0 - share) * np.exp(-away / length_m) + share * np.eye(len(rows))))
    return parts


def find_correlation(medians: PlaceMedians, design: Floats, left: Floats) -> tuple[float, float]:
    """The likeliest length [m], up to as long as the floor, and share."""
    extent = max(extent_m(medians.x, medians.y), 1e-3)
    tried = [(float(length), share) for length in np.geomspace(0.02 * extent, extent, LENGTHS) for share in SHARES[:-1]]
    return min([*tried, (extent, 1.0)], key=lambda pair: likelihood(blocks(medians, *pair), design, left)[0])


def likelihood(parts: list[tuple[Whole, Floats]], design: Floats, left: Floats) -> tuple[float, float]:
    """Minus twice the restricted log-likelihood, its variance profiled out, and that variance."""
    size = design.shape[1]
    normal, moment, square, logs = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for rows, alike in parts:
        root = np.linalg.cholesky(alike + 1e-9 * np.eye(len(rows)))
        own = np.linalg.solve(root, np.column_stack([design[rows], left[rows]]))
        normal += own[:, :-1].T @ own[:, :-1]
        moment += own[:, :-1].T @ own[:, -1]
        square += float(own[:, -1] @ own[:, -1])
        logs += 2.0 * float(np.log(np.diag(root)).sum())
    freedom = len(left) - size
    variance = max(float(square - moment @ np.linalg.solve(normal, moment)) / freedom, 1e-18)
    return logs + float(np.linalg.slogdet(normal)[1]) + freedom * math.log(variance), variance
