"""Covariances of a few states as rows of plain numbers: for ten states that is faster than arrays.

A filter that takes readings one at a time needs no more: further states, and the gain of one reading. Rows are not
written to; every function answers new ones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

Row = list[float]
LONG = 6
"""Number of gains beyond which linear algebra is faster."""


def with_states(mean: Row, rows: list[Row], variances: Sequence[float]) -> tuple[Row, list[Row]]:
    """Further states of mean zero, each independent of all others."""
    count, more = len(mean), len(variances)
    wider = [[*row, *[0.0] * more] for row in rows]
    for i, variance in enumerate(variances):
        wider.append([0.0] * (count + more))
        wider[-1][count + i] = variance
    return [*mean, *[0.0] * more], wider


def shared_with(rows: Sequence[Row], jacobian: Mapping[int, float]) -> Row:
    """P Hᵀ, the covariance of the states with what one reading shows."""
    (i, by), *others = jacobian.items()
    shared = [by * p for p in rows[i]]
    for i, by in others:
        shared = [s + by * p for s, p in zip(shared, rows[i])]
    return shared


def scaled_gain(
    shared: Row, jacobian: Mapping[int, float], gains: Sequence[Row], variance: float, innovation: float
) -> tuple[Row, float]:
    """The gain of one scalar reading over the root of its innovation's variance, and the innovation over that root.

    P after the readings before is P - Σ g gᵀ of their ``gains``, so P Hᵀ is ``shared`` - Σ g (H g): the covariance is
    written once a scan only, and stays symmetric to the last bit (Potter's form: Bierman 1977, section II.3).
    """
    for gain in gains:
        part = sum(by * gain[i] for i, by in jacobian.items())
        shared = [s - part * g for s, g in zip(shared, gain)]
    root = 1.0 / math.sqrt(variance + sum(by * shared[i] for i, by in jacobian.items()))
    return [s * root for s in shared], innovation * root


def without(rows: list[Row], gains: Sequence[Row]) -> list[Row]:
    """P - Σ g gᵀ: three gains at a time, or by linear algebra where many anchors make both long."""
    if len(gains) > LONG:
        columns = np.array(gains)
        return (np.array(rows) - columns.T @ columns).tolist()  # type: ignore[no-any-return]
    for first in range(0, len(gains), 3):
        one, two, three = (*gains[first : first + 3], *[[0.0] * len(rows)] * 2)[:3]
        rows = [
            [p - a * x - b * y - c * z for p, x, y, z in zip(row, one, two, three)]
            for row, a, b, c in zip(rows, one, two, three)
        ]
    return rows
