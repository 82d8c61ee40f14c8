"""Claim of each answer, as a Gaussian, against the truth: NEES and the proper scores, instant by instant."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fusion.arrays import Flags, Floats, points

DIRECTIONS = 8
"""Of the energy score: a mean over instants is then right to 0.2 %, of hopeless claims to 0.6 %."""
ANGLES = (np.arange(DIRECTIONS)[:, None] + 0.5) * (np.pi / DIRECTIONS)
REACH = np.abs(np.cos(ANGLES)).astype(np.float32)
"""Share of the error in each direction, (directions, 1). Single precision is ample here, and twice as fast."""
HARMONICS = np.hstack([np.ones_like(ANGLES), np.cos(2.0 * ANGLES), -np.sin(2.0 * ANGLES)]).astype(np.float32)
"""A variance in each direction from its mean and its second harmonic, (directions, 3)."""
ALL_REACH = float(np.abs(np.cos(ANGLES)).sum())
LEAST_VARIANCE = np.float32(1e-30)
"""[m²], of a claim that is certain, or none at all."""
PER_DIRECTION = 0.5 * math.pi / DIRECTIONS
MEAN_SIZE, HALF_MEAN_DIFFERENCE = math.sqrt(2.0 / math.pi), math.sqrt(1.0 / math.pi)
"""Of a standard Gaussian, and of two of them."""
BY_STD = 0.47047 * math.sqrt(0.5)
LOG_TAU = float(np.log(2.0 * np.pi))


class Claims(NamedTuple):
    """Squared Mahalanobis distance, negative log density [nat] and energy score [m] of the errors, all (n,).

    ``nees`` and ``nll`` are those of the pose, NaN where a heading is missing; ``_2d`` and ``energy`` of the position.
    All NaN where no covariance was claimed; a singular one makes the first four infinite.
    """

    nees: Floats
    nees_2d: Floats
    nll: Floats
    nll_2d: Floats
    energy: Floats


def judge(dx: Floats, dy: Floats, turn: Floats, covariance: Floats) -> Claims:
    """Of signed errors (n,) [m, m, rad], NaN where there was no answer, and covariances (n, 6), NaN without claim.

    eᵀ P⁻¹ e (Bar-Shalom, Li & Kirubarajan 2001) by P = L D Lᵀ, written out: one stacked solve costs ten times more.
    """
    if not np.isfinite(covariance[:, 0]).any():
        return Claims(*[np.full(len(dx), np.nan)] * 5)
    xx, xy, xh, yy, yh, hh = np.ascontiguousarray(covariance.T)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        by_x, heading_by_x = xy / xx, xh / xx
        pivot_y = yy - by_x * xy
        heading_by_y = (yh - by_x * xh) / pivot_y
        pivot_h = hh - heading_by_x * xh - heading_by_y * heading_by_y * pivot_y
        across = dy - by_x * dx
        nees_2d = dx * dx / xx + across * across / pivot_y
        rest = turn - heading_by_x * dx - heading_by_y * across
        nees = nees_2d + rest * rest / pivot_h
        area = xx * pivot_y
        nll_2d = LOG_TAU + 0.5 * (np.log(area) + nees_2d)
        nll = 1.5 * LOG_TAU + 0.5 * (np.log(area * pivot_h) + nees)
    energy = energy_scores(dx, dy, xx, xy, yy)
    if (np.isfinite(nll) & (np.minimum(np.minimum(xx, pivot_y), pivot_h) > 0.0)).all():
        return Claims(nees, nees_2d, nll, nll_2d, energy)
    sound_2d = (xx > 0.0) & (pivot_y > 0.0)
    sound = sound_2d & (pivot_h > 0.0)
    claimed_2d = np.isfinite(xx + xy + yy + dx)
    claimed = claimed_2d & np.isfinite(xh + yh + hh + turn)
    nees, nll = (_settled(values, sound, claimed) for values in (nees, nll))
    nees_2d, nll_2d = (_settled(values, sound_2d, claimed_2d) for values in (nees_2d, nll_2d))
    return Claims(nees, nees_2d, nll, nll_2d, energy)


def _settled(values: Floats, sound: Flags, claimed: Flags) -> Floats:
    return np.where(claimed, np.where(sound, values, np.inf), np.nan)


def energy_scores(dx: Floats, dy: Floats, xx: Floats, xy: Floats, yy: Floats) -> Floats:
    """Energy score (Gneiting & Raftery 2007, eq. 22) of the position each answer claimed, (n,) [m]: smaller is better.

    E‖X - p‖ - E‖X - X'‖ / 2 needs no draws. In the plane ‖v‖ is pi / 2 times the mean of |v . u| over all directions
    u, so the score is pi / 2 times the mean over directions of the one-dimensional score, which for a Gaussian has
    the closed form below (ibid., section 4.2). A mean over equally spaced directions, counted from that of the error
    so that no frame is preferred, converges exponentially.
    """
    error = np.abs(points(dx, dy))
    somewhere = np.where(error > 0.0, error, 1.0)
    x, y = dx / somewhere, dy / somewhere
    cos, sin = 1.0 - 2.0 * y * y, 2.0 * x * y
    half = 0.5 * (xx - yy)
    harmonics = np.array([0.5 * (xx + yy), half * cos + xy * sin, half * sin - xy * cos], dtype=np.float32)
    with np.errstate(over="ignore"):
        std = np.sqrt(np.maximum(HARMONICS @ harmonics, LEAST_VARIANCE))
        by_std = REACH * error.astype(np.float32) / std
        density = np.exp(-0.5 * by_std * by_std)
    spread = density * (MEAN_SIZE - by_std * _tail(by_std)) - HALF_MEAN_DIFFERENCE
    return np.asarray(PER_DIRECTION * (ALL_REACH * error + np.add.reduce(std * spread, axis=0)))


def _tail(by_std: Floats) -> Floats:
    """(1 - erf(z / √2)) / exp(-z² / 2) for z >= 0, to 2.5e-5: Abramowitz & Stegun 1964, 7.1.25.

    Ample beside what the few directions leave, and a tenth of the time of an exact erf, which has branches.
    """
    t = 1.0 / (1.0 + BY_STD * by_std)
    return np.asarray(t * (0.3480242 + t * (-0.0958798 + t * 0.7478556)))
